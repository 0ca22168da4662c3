"""Matches that contradict the motion are told by what lasts of it; those that err alike weigh less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stages.motion.bundle_adjustment.equations import Scales, linearised, scales_of
from stages.motion.parameters import MotionParameters
from stages.motion.windows.sliding_window import excess_of, lasting_excess
from tests.motion_scene import scene

LANDMARKS, SEEN = 2000, 12


def errors(noise: float, lasting: float) -> tuple[np.ndarray, np.ndarray]:
    """Return errors in σ, new in every picture and the same in all of a landmark, and its number."""
    random = np.random.default_rng(0)
    landmark = np.repeat(np.arange(LANDMARKS), SEEN)
    alike = random.standard_normal((LANDMARKS, 2))[landmark]
    return noise * random.standard_normal((len(landmark), 2)) + lasting * alike, landmark


@pytest.mark.parametrize("noise", [0.5, 1.2])
def test_noise_however_large_does_not_last(noise: float) -> None:
    """Open-3 is sound, and its matches err by 1.12 times their σ, anew in every picture."""
    in_sigma, landmark = errors(noise, 0.0)
    assert excess_of(in_sigma) == pytest.approx(noise, rel=0.05)
    assert lasting_excess(in_sigma, landmark) < 0.25 * noise


def test_what_neighbouring_matches_share_lasts() -> None:
    in_sigma, landmark = errors(0.9, 0.7)
    assert lasting_excess(in_sigma, landmark) == pytest.approx(0.7, abs=0.07)
    assert lasting_excess(in_sigma[:0], landmark[:0]) == 0


def test_matches_that_err_alike_weigh_less_and_outliers_among_them_no_more() -> None:
    """Judged by a σ widened for what matches share, an outlier of ten spreads would count whole."""
    given, alike = scene(10, 30, noise=1.0, seed=3), 15.0
    tracks = given.measured.tracks
    uv = tracks.uv.copy()
    uv[::10] += 1.0  # ten times its σ
    measured = replace(given.measured, tracks=replace(tracks, uv=uv))
    weights = []
    for number in (1.0, alike):
        parameters = MotionParameters(alike=number)
        first = linearised(given.truth, measured, parameters, Scales(1.0, 0.1))
        scales = scales_of(first, measured.tracks, number)
        weights.append(linearised(given.truth, measured, parameters, scales).texture.weight)
    np.testing.assert_allclose(weights[1] * alike, weights[0], rtol=1e-9)
    assert np.median(weights[1][::10]) < 0.1 * np.median(weights[1])
