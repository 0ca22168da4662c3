"""The motion between lit pictures is as uneven as a sound encoder shows, and smooth beside a noisy one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.geometry.axis import distance_along
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.bundle_adjustment.uneven_steps import uneven_steps
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.landmarks import TrackedPoses
from tests.motion_scene import scene

FRAMES, QUANTUM = 80, 0.05
TIME_S = np.arange(FRAMES) / 30
STEPS_MM = np.where(np.arange(FRAMES) % 2, 0.6, 4.0)
"""Two pictures, laser and LED, after each step of a crawler."""


def lit(way_mm: Float) -> TrackedPoses:
    """Return the poses of every other frame at distances (N,) of all."""
    T_pc = np.tile(np.eye(4), (FRAMES // 2, 1, 1))
    T_pc[:, 2, 3] = way_mm[1::2]
    return TrackedPoses(np.arange(1, FRAMES, 2), T_pc, np.zeros(FRAMES // 2, bool))


def readings(way_mm: Float) -> EncoderReadings:
    rounded = np.round(way_mm / QUANTUM) * QUANTUM
    return EncoderReadings(rounded, QUANTUM / 12**0.5, np.ones(FRAMES, bool))


@pytest.mark.parametrize("scale", [1.0, 1.01])
def test_a_crawler_that_moves_on_between_pairs_of_pictures_is_seen_in_its_encoder(scale: float) -> None:
    way_mm = np.cumsum(STEPS_MM)
    found = uneven_steps(readings(scale * way_mm), lit(way_mm), TIME_S)
    assert found[2] > 10, "its third differences are 14 mm"
    assert not found[[0, 1, 3, 4, 5]].any()
    assert not uneven_steps(None, lit(way_mm), TIME_S).any()


@pytest.mark.parametrize("seed", range(20))
def test_noisy_readings_do_not_make_a_motion_uneven(seed: int) -> None:
    """Late stamps of frames, a shaking wheel or rounding show in the lit pictures as well."""
    random = np.random.default_rng(seed)
    way_mm = 18 * TIME_S + 0.9 * np.sin(1.7 * TIME_S)
    for noise_mm in (0.0, 0.1, 1.0):
        read = readings(1.01 * way_mm + noise_mm * random.standard_normal(FRAMES))
        assert not uneven_steps(read, lit(way_mm), TIME_S).any()


def test_laser_frames_lie_where_the_encoder_shows_them() -> None:
    """They lay half-way between the lit pictures, 1.7 mm off, and the texture was that far from the wall."""
    made = scene(40, 200, noise=1.0, pairs_mm=1.2)
    measured, laser = made.measured, np.arange(40) % 2 == 0
    tracks = measured.tracks.some(~laser[measured.tracks.frame])[0]
    poses = measured.tracks.poses
    odd = TrackedPoses(poses.frames[~laser], poses.T_pc[~laser], poses.lost[~laser])
    measured = replace(measured, tracks=replace(tracks, poses=odd))
    start = replace(made.truth, xyz_p=tracks.xyz)
    state = estimate_state(start, measured, MotionParameters()).state
    off = distance_along(state.axis, state.T_pc) - distance_along(made.truth.axis, made.truth.T_pc)
    assert abs(np.median(off[laser]) - np.median(off[~laser])) < 0.05, "it was .6 mm"
