"""The kind of a defect follows from features with their σ, and from sizes that may grow with the pipe."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.artefacts.findings import DefectKind
from stages.defects.portraits import Features, Likeness, probabilities
from stages.defects.segment import Region

INWARD, OUTWARD = (Region(0, 0, np.ones((4, 4), bool), sign) for sign in (-1.0, 1.0))


def told(features: Features, region: Region, radius_mm: float) -> tuple[DefectKind, float]:
    return next(iter(probabilities(features, region, radius_mm).items()))


def of(slim_mm: float, elongation: float, roughness: float, sigma: float = 0.02) -> Features:
    return Features(slim_mm * elongation, slim_mm, slim_mm, elongation, roughness, sigma, 0.0)


def test_in_a_narrow_pipe_a_narrow_dent_is_a_dent() -> None:
    """In most copies of open-3, a pipe of 2 inch, dent and corrosion were called deposit and pit."""
    dent, corrosion = of(11.0, 1.1, 0.0), of(8.2, 1.6, 0.06)
    assert told(dent, INWARD, 25.4)[0] is DefectKind.DENT
    assert told(corrosion, OUTWARD, 25.4)[0] is DefectKind.CORROSION
    assert told(corrosion, OUTWARD, 50.8)[0] is DefectKind.PIT


@pytest.mark.parametrize(("radius_mm", "times"), [(50.8, 1.0), (25.4, 0.5**0.5), (203.2, 2.0)])
def test_usual_sizes_scale_by_half_with_the_pipe_and_are_less_sure(radius_mm: float, times: float) -> None:
    usual = Likeness(10.0, 1.5)
    other = usual.in_pipe(radius_mm)
    assert other.median == pytest.approx(10 * times)
    assert np.log(other.factor) == pytest.approx(np.hypot(np.log(1.5), np.log(times)))


def test_an_uncertain_feature_hardly_affects_the_kind() -> None:
    smooth, rough = Likeness(0.03, 1.7), Likeness(0.12, 1.8)
    apart = [
        abs(smooth.log_likelihood(0.03, sigma) - rough.log_likelihood(0.03, sigma))
        for sigma in (0.001, 0.03, 0.3)
    ]
    assert apart[0] > 2.0 > apart[1] > apart[2]
    assert apart[2] < 0.5


def test_a_line_seen_as_a_mean_over_a_millimetre_may_be_crack_or_gouge() -> None:
    kind, share = told(of(1.2, 9.0, 0.08, 0.08), OUTWARD, 50.8)
    assert kind in (DefectKind.CRACK, DefectKind.GOUGE)
    assert share < 0.9
