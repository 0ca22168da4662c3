"""Terms without a name that stand for whatever the library lacks, and their formulas."""

import numpy as np
import pytest

from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.library import (
    LIBRARY,
    columns,
    ring_shift_px,
    texture_columns,
    texture_shift_px,
)
from stages.diagnose.effects.nameless import STEADY, Moves, PatternInCourse
from stages.diagnose.effects.vocabulary import GENERIC
from tests.unit.effect_points import line, texture
from tests.unit.wall_points import Bore, plain_probe, ring_points, texture_points


def generic_columns(points, wanted, of_line):
    """Return columns of the generic terms of the line or of the image, constant and linear in time."""
    terms = [term for term in GENERIC if (term.moves is Moves.LINE) is of_line]
    growing = [(PatternInCourse(term, CourseKind.RAMP), (10.0,)) for term in terms]
    each = [*((term, STEADY) for term in terms), *growing]
    return np.concatenate([wanted(model, points, shape) for model, shape in each], axis=-1)


def test_generic_terms_can_mimic_a_tilted_sheet_but_not_everything():
    rings = [
        ring_points(plain_probe(), Bore(r), 90, time_s=t) for r, t in ((35.0, 1.0), (42.0, 4.0), (50.8, 9.0))
    ]
    basis = np.concatenate([generic_columns(ring, columns, of_line=True) for ring in rings])

    def left(model, shape=()):
        column = np.concatenate([columns(model, ring, shape) for ring in rings])[:, 0]
        fitted = basis @ np.linalg.lstsq(basis, column, rcond=1e-12)[0]
        return np.linalg.norm(column - fitted) / np.linalg.norm(column)

    assert basis.shape == (270, 72)
    assert left(LIBRARY["laser_tilt"]) < 1e-6
    assert left(LIBRARY["sheet_waviness"], (6.0,)) > 0.5


@pytest.mark.parametrize("name", ["principal_point", "focal_scale", "radial_distortion", "sensor_tilt"])
def test_generic_terms_can_mimic_a_wrong_lens_on_texture(name):
    walls = [texture_points(plain_probe(), Bore(42.0), ahead) for ahead in (10.0, 25.0, 45.0, 80.0)]
    basis = np.concatenate([generic_columns(wall, texture_columns, of_line=False) for wall in walls]).reshape(
        -1, 144
    )
    column = np.concatenate([texture_columns(LIBRARY[name], wall, ()) for wall in walls])[..., 0].ravel()
    fitted = basis @ np.linalg.lstsq(basis, column, rcond=1e-12)[0]
    assert np.linalg.norm(column - fitted) < 1e-6 * np.linalg.norm(column)


def test_generic_terms_move_either_the_line_or_the_whole_image():
    points, wall = line(), texture()
    for term in GENERIC:
        size = np.full(len(term.amplitudes), 0.1)
        assert ring_shift_px(term, points, (0.0,), size).any() or term.moves is Moves.AROUND
        assert bool(texture_shift_px(term, wall, (0.0,), size).any()) == (term.moves is not Moves.LINE)


@pytest.mark.parametrize(
    ("moves", "exponent", "formula"),
    [
        (Moves.LINE, 0, "δr = a cos 2(ψ − ψ₀)"),
        (Moves.LINE, 1, "δr = a (r/50)^1 cos 2(ψ − ψ₀)"),
        (Moves.OUTWARD, 0, "image outward: a cos 2(ψ − ψ₀)"),
        (Moves.OUTWARD, 3, "image outward: a θ^3 cos 2(ψ − ψ₀)"),
    ],
)
def test_a_formula_has_no_power_of_nought(moves: Moves, exponent: int, formula: str) -> None:
    (term,) = (g for g in GENERIC if (g.moves, g.harmonic, g.exponent) == (moves, 2, exponent))
    assert term.formula(STEADY) == formula
