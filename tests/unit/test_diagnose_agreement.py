"""How the estimates of an effect by two measurements are written, with their σ."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from stages.diagnose.agreement import chance_of_name, drawn, sized, turn_deg
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.effects.vocabulary import GENERIC
from tests.diagnosed import AGREES, DIFFERS


@pytest.mark.parametrize("direction_deg", [25.0, 180.0])
def test_size_and_direction_each_have_the_right_sigma(direction_deg: float) -> None:
    """Compared with draws of the amplitudes.

    The error of a direction is σ over size, and 180° is not a limit.
    """
    tilt = LIBRARY["laser_tilt"]
    at = np.radians(direction_deg)
    amplitude = 0.006 * np.array([np.cos(at), np.sin(at)])
    covariance = np.array([[4e-8, 1e-8], [1e-8, 2e-8]])
    numbers = re.findall(r"(\w+) \S+ ± (\S+?)(?:,|$)", sized(tilt, (), amplitude, covariance))
    told = {name: float(sigma) for name, sigma in numbers}
    drawn = np.random.default_rng(1).multivariate_normal(amplitude, covariance, 4000)
    found = [tilt.quantities((), a) for a in drawn]
    middle = tilt.quantities((), amplitude)
    for name, sigma in told.items():
        off = np.array([f[name] - middle[name] for f in found])
        assert sigma == pytest.approx(np.std((off + 180) % 360 - 180), rel=0.1)
    assert set(told) == {"tilt_deg", "direction_deg"}


def test_of_several_confirmations_only_the_best_counts_also_in_another_recording() -> None:
    """A cause that stays passes the halves of one recording and another one: both odds were multiplied."""
    there = replace(AGREES, ratio=7.7)
    alone, both = (chance_of_name(1e-70, 0, of, fits_p=0.054) for of in ([AGREES], [AGREES, AGREES, there]))
    assert both == alone < chance_of_name(1e-70, 0, [AGREES, replace(there, ratio=2 * AGREES.ratio)], 0.054)
    assert chance_of_name(1e-70, 0, [AGREES, DIFFERS]) < 0.1


@pytest.mark.parametrize(
    ("name", "shape", "amplitude", "turn"),
    [
        ("laser_rocking", (4.75,), [1e-6, 2e-3, 1e-6, 1e-3], 180.0),
        ("sheet_waviness", (3.0,), [-1e-3, 1e-6], 120.0),
        ("sheet_waviness", (2.0,), [-1e-3, 1e-6], 180.0),
        ("laser_tilt", (), [-6e-3, 1e-6], 360.0),
        ("generic_line_2_1", (), [-0.05, 1e-6], 180.0),
    ],
)
def test_a_direction_at_the_edge_of_its_range_is_as_well_known_as_any(name, shape, amplitude, turn) -> None:
    """A sheet rocking toward 88.0° was told to rock toward -90.6 ± 110.8°, which is 89.4 ± 1.4°."""
    model = (LIBRARY | {m.name: m for m in GENERIC})[name]
    middle = np.array(amplitude)
    assert turn_deg(model, shape, middle) == turn
    covariance = (0.01 * np.linalg.norm(middle)) ** 2 * np.eye(len(middle))
    found = drawn(partial(model.quantities, shape), middle, covariance, turn)["direction_deg"]
    assert 0.1 < found.sd < 1.0
