"""What the brightness of the lit wall shows of the lens, and what it cannot show, since LEDs differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from pipeline.arrays import Image
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.recording.base import FrameTable, PipeFacts, Planes, Recording
from stages.diagnose.profile.brightness import vignetting_finding
from stages.texture.light import irradiance

SIZE, FRAMES = (640, 480), 24


class Lit:
    """A lit wall whose light falls as cos^k θ relative to the stated lights, with noise."""

    image_size = SIZE

    def __init__(self, probe: Probe, falloff: float) -> None:
        column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
        ray = probe.camera.unproject(np.stack([column, row], -1).reshape(-1, 2).astype(float)).ray
        across = np.maximum(np.hypot(ray[:, 0], ray[:, 1]), 1e-3)
        wall = ray * (50.8 / across)[:, None]
        inward = np.stack([-ray[:, 0] / across, -ray[:, 1] / across, 0 * across], -1)
        light = irradiance(probe.lighting, wall, inward) * np.maximum(ray[:, 2], 0.01) ** falloff
        seen = (across > 0.36) & (across < 0.93)
        self._grey = np.where(seen, 180 * light / light[seen].max(), 0).reshape(SIZE[::-1])

    def read(self, frames: Sequence[int], planes: Planes) -> Iterator[tuple[int, Image | None]]:
        for frame in frames:
            grey = self._grey + 16 + np.random.default_rng(frame).normal(0, 1, self._grey.shape)
            yield int(frame), np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def found(falloff: float) -> tuple[bool, float]:
    camera = KannalaBrandt(SIZE, (150.0, 150.0), (320.0, 240.0), (-0.012, 0.001, -0.0008, 0.0))
    probe = Probe(camera, LaserSheet(22.0), np.zeros((20, 20)))
    table = FrameTable(np.arange(FRAMES), np.arange(FRAMES) / 30, np.full(FRAMES, "led"))
    pipe = PipeFacts(101.6, None, (), 0.0, None)
    recording = Recording(
        "lit", "inspection", Path("lit"), table, None, pipe, 30.0, Lit(probe, falloff), None, "lit"
    )
    told = vignetting_finding(recording, probe)
    return told.found, told.sizes[0].value if told.sizes else np.nan


def test_lights_wider_than_lamberts_law_are_not_an_error_of_the_lens() -> None:
    """LEDs that shine equally to all sides made a sound probe a class of five names."""
    is_found, falloff = found(-0.8)
    assert falloff == pytest.approx(-0.8, abs=0.15)
    assert not is_found


def test_a_lens_that_darkens_its_edge_more_than_any_light_can_is_found() -> None:
    is_found, falloff = found(4.0)
    assert falloff == pytest.approx(4.0, abs=0.2)
    assert is_found
