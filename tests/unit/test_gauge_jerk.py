"""A gauge run whose speed changes abruptly: the prior of smooth motion does not outweigh the fiducials."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.diagnose import channels
from stages.diagnose.gauge.search import prepare
from stages.diagnose.travel.sight import place_sigma_mm
from tests import gauge_runs
from tests.gauge_runs import GaugeRun, made_run, measured_run

_FRAMES = 90
# Speeds, mm per frame, and the frames from which on they hold: forward, back, slowly, fast.
_SPEEDS = ((0, 2.0), (40, -1.2), (56, 0.7), (66, 2.3))


def _pulled(frames: int, random: np.random.Generator) -> Float:
    """Return the poses (N, 4, 4) of a probe that changes its speed within three frames."""
    frame = np.arange(frames)
    speed = np.array(_SPEEDS)[np.searchsorted([f for f, _ in _SPEEDS], frame, side="right") - 1, 1]
    speed = np.convolve(np.pad(speed, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")
    wave = [3 * np.sin(frame / 9 + p) for p in random.uniform(0, 2 * np.pi, 2)]
    place = np.stack([*wave, np.cumsum(speed) - 22], -1)
    return from_parts(rotation_from_vector(np.stack([0 * frame, 0 * frame, 0.05 * frame], -1)), place)


_UNPLACED = 8


@pytest.fixture(scope="module")
def run() -> GaugeRun:
    """Return a run in which every second lit frame shows only borders along the pipe, which place nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gauge_runs, "driven", _pulled)
        made = made_run(5, frames=_FRAMES)
    along = (made.edges.side % 2 == 1) & (made.edges.marker % 2 == 0)
    return replace(made, edges=made.edges.select(along | (made.edges.frame % _UNPLACED == 3)))


def test_poses_follow_an_abrupt_change_of_speed(run: GaugeRun) -> None:
    measured = measured_run(run)
    _, state = prepare(measured)
    off = (state.T_pc[:, 2, 3] - _pulled(_FRAMES, np.random.default_rng(0))[:, 2, 3])[measured.posed]
    assert np.abs(off - np.median(off)).max() < 0.2


def test_only_frames_whose_own_fiducials_place_them_are_compared_with_the_encoder(
    run: GaugeRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = measured_run(run)
    by_itself = measured.posed % _UNPLACED == 3
    sigma = place_sigma_mm(measured.start, measured.measured.edges)[measured.posed]
    assert sigma[by_itself].max() < 0.02
    assert sigma[~by_itself].min() > 1
    given: list[Any] = []
    monkeypatch.setattr(channels, "travel_evidence", lambda *each: given.extend(each))
    channels.gauge_travel(run.recording, measured, measured.start)
    placed = measured.posed[by_itself]
    np.testing.assert_array_equal(given[2].frame, placed)
    np.testing.assert_array_equal(given[3], measured.start.T_pc[placed[0] : placed[-1] + 1])
