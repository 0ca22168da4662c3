"""Matches that contradict the motion are recognised by the lasting part of their errors, not by noise."""

from __future__ import annotations

import numpy as np
import pytest

from stages.motion.bundle_adjustment.match_errors import excess_of, lasting_excess

LANDMARKS, SEEN = 2000, 12


def errors(noise: float, lasting: float) -> tuple[np.ndarray, np.ndarray]:
    """Return errors in σ, independent in every picture plus one for each landmark, and its number."""
    random = np.random.default_rng(0)
    landmark = np.repeat(np.arange(LANDMARKS), SEEN)
    alike = random.standard_normal((LANDMARKS, 2))[landmark]
    return noise * random.standard_normal((len(landmark), 2)) + lasting * alike, landmark


@pytest.mark.parametrize("noise", [0.5, 1.2])
def test_noise_of_any_size_has_no_lasting_part(noise: float) -> None:
    """Open-3 is sound, and its matches err by 1.12 times their σ, independently in every picture."""
    in_sigma, landmark = errors(noise, 0.0)
    assert excess_of(in_sigma) == pytest.approx(noise, rel=0.05)
    assert lasting_excess(in_sigma, landmark) < 0.25 * noise


def test_errors_that_neighbouring_matches_share_count_as_lasting() -> None:
    in_sigma, landmark = errors(0.9, 0.7)
    assert lasting_excess(in_sigma, landmark) == pytest.approx(0.7, abs=0.07)
    assert lasting_excess(in_sigma[:0], landmark[:0]) == 0
