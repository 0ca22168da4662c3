"""Simulated recordings for the stage premises: laser and LED frames alternate.

Laser frames show a closed line.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from stages.premises import PremisesParameters, check_premises
from tests.drawn_run import BASELINE, RADIUS, drawn_run
from tests.quiet import quiet_context
from tests.ring_images import MemorySource

COUNT, STEP_MM = 60, 1.0


@cache
def steady_run():
    """Return a run of `COUNT` frames at constant speed."""
    return drawn_run(STEP_MM * np.arange(COUNT), np.zeros(COUNT))


@cache
def good_recording():
    """Return the recording of that run, with its laser frames drawn as well."""
    return with_rings(steady_run())


def with_rings(run):
    """Return the recording of a simulated run whose laser frames show a closed line in the dark."""
    lines = {int(f): ring_image(run.probe, seed=int(f)) for f in run.rings.frame}
    source = MemorySource({**run.recording.source.images, **lines}, run.probe.camera.image_size)
    return replace(run.recording, source=source)


def ring_image(probe, seed=0):
    width, height = probe.camera.image_size
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    seen = probe.camera.project(np.array([RADIUS, 0.0, BASELINE])).uv[0] - probe.camera.centre_px[0]
    off = np.hypot(u - probe.camera.centre_px[0], v - probe.camera.centre_px[1]) - seen
    noise = np.random.default_rng(seed).standard_normal(off.shape)
    return np.clip(np.rint(4 + 180 * np.exp(-0.5 * (off / 1.2) ** 2) + noise), 0, 255).astype(np.uint8)


def checked(recording, probe, **parameters):
    told = []
    context = replace(quiet_context(), warn=told.append)
    return check_premises(recording, probe, PremisesParameters(**parameters), context), told
