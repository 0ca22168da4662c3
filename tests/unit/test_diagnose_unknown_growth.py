"""Unknown laws grow as differently from a named one as the library's laws do from each other."""

from itertools import permutations
from math import erf

import numpy as np

from stages.diagnose.effects.library import LIBRARY, ring_shift_px
from stages.diagnose.gauge.unknown_laws import GROWTH
from tests.unit.wall_points import Bore, plain_probe, ring_points

# Laws that are the same all round: of the sheet, growing with the wall's radius, and of the picture.
OF_SHEET = "laser_cone", "baseline"
OF_PICTURE = "focal_scale", "radial_distortion", "pupil_shift", "housing_glass", "dome_axial", "outside_index"
BORES = [ring_points(plain_probe(), Bore(radius), 90) for radius in (35.0, 42.0, 50.8)]


def shift_px(name: str) -> np.ndarray:
    model = LIBRARY[name]
    size = np.array([a.plausible for a in model.amplitudes])
    return np.concatenate([ring_shift_px(model, at, model.shapes(7.0, 15.0)[0], size) for at in BORES])


def first_power(one: str, other: str, radius: np.ndarray) -> float:
    """Return by how much, relative to one law, another differs in the first power of the radius."""
    off = radius / np.median(radius) - 1
    powers = np.stack([shift_px(one) * off**n for n in range(3)], 1)
    scale = np.linalg.norm(powers, axis=0)
    found = np.linalg.lstsq(powers / scale, shift_px(other))[0] / scale
    return float(abs(found[1] / found[0]))


def test_few_laws_of_the_library_and_as_few_unknown_ones_grow_nearly_as_a_named_one():
    """Quantiles had been taken for 1 σ: three times as many unknown laws were nearly the named one."""
    of_line = np.concatenate([at.radius_mm for at in BORES])
    of_picture = np.concatenate([at.theta for at in BORES])
    apart = [first_power(*pair, of_line) for pair in permutations(OF_SHEET, 2)]
    apart += [first_power(*pair, of_picture) for pair in permutations(OF_PICTURE, 2)]
    nearest = float(np.quantile(apart, 0.1))
    below = [erf(nearest / (sigma * np.sqrt(2))) for sigma in GROWTH]
    assert abs(np.mean(below) - 0.1) < 0.05
