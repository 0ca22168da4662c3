"""Errors that matches of texture share, and distances without an encoder."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.adjustment.bordered import Factor
from pipeline.arrays import Float
from pipeline.geometry.rigid import inverse, transform
from stages.motion.bundle_adjustment.equations import MATCH_BIASES
from stages.motion.bundle_adjustment.solver import (
    adjust,
    estimate_again,
    estimate_state,
    scale_between_halves,
)
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.strips import StripGrid
from stages.motion.windows.shared_error import scale_by_lag
from tests.motion_scene import scene

FRAMES = 40


def last_frame_covariance(factor: Factor) -> Float:
    """Return the marginal covariance (7, 7) of the last of 40 frames."""
    return np.asarray(factor.joint_covariance(np.array([FRAMES - 1]))[0, :, 0])


def test_match_biases_are_the_last_parameters() -> None:
    given = scene(8, 14, seed=2)
    assert len(given.truth.instrument) == given.measured.unsure.shape[1] + MATCH_BIASES


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_of_matches_alone_does_not_lengthen_the_distance(seed: int) -> None:
    """Noise and its opposite err oppositely, but for a bias: 1.2 σ with the direction of the match."""
    given = scene(FRAMES, 400, encoder=False, seed=seed)
    tracks, truth = given.measured.tracks, given.truth
    noise = tracks.sigma_px[:, None] * np.random.default_rng(seed).standard_normal(tracks.uv.shape)
    in_sigma = []
    for uv in (tracks.uv + noise, tracks.uv - noise):
        measured = replace(given.measured, tracks=replace(tracks, uv=uv))
        found = adjust(truth, measured, MotionParameters(alike=1.0), 1e-5)
        sigma = np.sqrt(last_frame_covariance(found.equations.factor())[2, 2])
        in_sigma.append((found.state.T_pc[-1, 2, 3] - truth.T_pc[-1, 2, 3]) / sigma)
    assert abs(np.mean(in_sigma)) < 0.3, in_sigma


@pytest.mark.parametrize("seed", [1, 2])
def test_a_bias_of_distant_matches_is_not_taken_for_distance(seed: int) -> None:
    """Compression removes texture far ahead: matches at less than 0.85 rad lag by up to 0.25 px."""
    given = scene(FRAMES, 90, encoder=False, seed=seed)
    tracks, truth = given.measured.tracks, given.truth
    xyz_c = transform(inverse(truth.T_pc[tracks.frame]), truth.xyz_p[tracks.landmark])
    beside = np.hypot(xyz_c[:, 0], xyz_c[:, 1])
    lag = -0.25 * np.clip((0.85 - np.arctan2(beside, xyz_c[:, 2])) / 0.15, 0, 1)
    uv = tracks.uv + lag[:, None] * xyz_c[:, :2] / beside[:, None]
    measured = replace(given.measured, tracks=replace(tracks, uv=uv))
    found = adjust(truth, measured, MotionParameters(alike=1.0), 1e-5)
    sigma = np.sqrt(last_frame_covariance(found.equations.factor())[2, 2])
    assert sigma < 0.1
    assert abs(found.state.T_pc[-1, 2, 3] - truth.T_pc[-1, 2, 3]) < 2 * sigma


def test_a_shift_of_near_matches_alone_makes_distances_unsure() -> None:
    given = scene(FRAMES, 90, encoder=False, seed=1)
    tracks, truth = given.measured.tracks, given.truth
    away = tracks.uv - given.measured.probe.camera.centre_px
    distance = np.linalg.norm(away, axis=1)
    near = distance > np.median(distance)
    shifted = tracks.uv + np.where(near, 1.0, 0.0)[:, None] * away / distance[:, None]
    unsure = []
    for uv in (tracks.uv, shifted):
        measured, parameters = (
            replace(given.measured, tracks=replace(tracks, uv=uv)),
            MotionParameters(alike=1.0),
        )
        found = estimate_state(truth, measured, parameters)
        unsure.append(scale_between_halves(found, measured, parameters))
    way = np.ptp(truth.T_pc[:, 2, 3])
    sigma = np.sqrt(last_frame_covariance(found.factor)[2, 2]) / way
    assert unsure[0] < 2 * sigma
    assert unsure[1] > 3 * unsure[0], unsure


def test_an_adjustment_to_a_larger_shared_error_goes_on_from_the_first() -> None:
    given = scene(FRAMES, 90, encoder=False, seed=1)
    first = estimate_state(given.truth, given.measured, MotionParameters(alike=1.0))
    noisier = MotionParameters(alike=1.0, match_bias_px=0.3)
    found = estimate_again(first, given.measured, noisier)
    afresh = estimate_state(first.state, given.measured, noisier)
    sigma = np.sqrt(last_frame_covariance(afresh.factor).diagonal()[:3])
    apart = found.state.T_pc[-1, :3, 3] - afresh.state.T_pc[-1, :3, 3]
    assert np.abs(apart / sigma).max() < 0.3
    assert found.adjusted.trials < afresh.adjusted.trials


def test_misplaced_templates_lengthen_the_distance_within_the_stated_sigma() -> None:
    """Landmarks seem to lie farther on by a lag that fades until they pass: residuals do not show it."""
    given, lag_px = scene(FRAMES, 90, encoder=False, seed=1), 0.3
    tracks, truth, camera = given.measured.tracks, given.truth, given.measured.probe.camera
    grid = StripGrid(truth.nominal_radius_mm, 360, *(truth.nominal_radius_mm / np.tan([1.4, 0.6])))
    stated = scale_by_lag(lag_px, grid, camera)
    xyz_c = transform(inverse(truth.T_pc[tracks.frame]), truth.xyz_p[tracks.landmark])
    xyz_c[:, 2] += stated * (xyz_c[:, 2] - grid.near_mm)
    uv = camera.project(xyz_c).uv
    farthest = np.argmin(np.linalg.norm(tracks.uv - camera.centre_px, axis=1))
    assert np.linalg.norm(uv - tracks.uv, axis=1)[farthest] == pytest.approx(lag_px, rel=0.1)
    measured = replace(given.measured, tracks=replace(tracks, uv=uv))
    found = estimate_state(truth, measured, MotionParameters(alike=1.0, match_bias_px=1e-3)).state
    way, true = (np.ptp(state.T_pc[:, 2, 3]) for state in (found, truth))
    assert way / true - 1 == pytest.approx(stated, rel=0.2)
