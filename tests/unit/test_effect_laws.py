"""Closed-form laws compared with traced and rendered rings, and replacements of the wrong ones."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.physics.catalogue import EFFECTS
from pipeline.simulator.effects.switch import Switch, typical_switch
from pipeline.simulator.laws import Check, bench_truth, trace_ring
from pipeline.simulator.laws.light import light_checks
from pipeline.simulator.laws.moving import moving_checks, odometry_checks
from pipeline.simulator.laws.radius import effect_ring, ghost_checks, radius_check, radius_checks
from pipeline.simulator.laws.table import table_text


@pytest.fixture(scope="module")
def checks() -> list[Check]:
    sources = (radius_checks, moving_checks, odometry_checks, light_checks, ghost_checks)
    return [check for source in sources for check in source()]


def test_laws_hold_except_those_known_to_be_wrong(checks: list[Check]) -> None:
    wrong = {(c.name, c.law) for c in checks if not c.agrees}
    assert wrong == {
        ("tube_tilt", "change of d(i)/sin θ; sheet side −(r/l) t χ (1 − 1/n) cos(ψ − ψ₀)"),
        ("line_skew", "bias ~ σ × skew"),
        ("vignetting", "−(S/f) σ_px² ∂ ln V/∂ρ"),
        ("ghost_ring", "odd m: 4 r ε_m"),
        ("pixel_locking", "δρ = a sin 2πρ"),
    }


def test_the_replacements_of_wrong_laws_hold(checks: list[Check]) -> None:
    for check in checks:
        assert check.agrees or check.mended_agrees, check
        assert check.agrees or check.mended


def test_every_effect_with_a_law_is_checked(checks: list[Check]) -> None:
    assert set(EFFECTS) <= {c.name for c in checks}


def test_the_table_has_a_row_for_every_check(checks: list[Check]) -> None:
    text = table_text(checks)
    assert sum(line.startswith("| ") for line in text.splitlines()) == len(checks) + 1
    assert text.count("**does not hold**") == sum(not c.agrees for c in checks)


def test_the_traced_ring_of_the_plain_instrument_is_read_without_error() -> None:
    for radius in (25.4, 50.8):
        assert np.abs(trace_ring(bench_truth(radius)).error_mm).max() < 1e-9


@pytest.mark.parametrize("name", ["laser_tilt", "focal_scale", "dome_lateral", "tube_wedge"])
def test_the_law_of_another_effect_is_not_confirmed(name: str) -> None:
    honest = radius_check(typical_switch(name))
    assert honest.agrees
    assert not replace(honest, computed=honest.computed + 0.05 * abs(honest.computed)).agrees
    assert not replace(honest, harmonic=(honest.harmonic[0], 3)).agrees if honest.harmonic else False
    assert (
        not replace(honest, exponent=(honest.exponent[0] + 0.1, honest.exponent[1])).agrees
        if honest.exponent
        else False
    )


@pytest.mark.parametrize("name", ["laser_cone", "focal_scale", "pupil_shift", "baseline", "dome_axial"])
def test_the_error_of_a_law_is_of_second_order(name: str) -> None:
    """Half the size leaves a quarter of the difference from the law."""
    typical = EFFECTS[name].quantities[0].typical
    left = []
    for size in (typical, typical / 2):
        check = radius_check(Switch(name, (size,)))
        slope = radius_check(Switch(name, (1e-3 * typical,))).computed / (1e-3 * typical)
        left.append(check.computed - slope * size)
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.1)


def test_the_exact_tilt_law_holds_at_three_degrees() -> None:
    ring = effect_ring(Switch("laser_tilt", (3.0, 40.0)), 50.8)
    x = 50.8 / 22 * math.tan(math.radians(3)) * np.cos(ring.azimuth_rad - math.radians(40))
    np.testing.assert_allclose(ring.error_mm, -50.8 * x / (1 + x), atol=1e-4)


def test_an_effect_moves_no_ring_that_it_should_not() -> None:
    """Effects of light, odometer and shutter leave the still ring where it is."""
    plain = trace_ring(bench_truth(50.8)).uv
    for name, effect in EFFECTS.items():
        if (
            effect.family == "photometric"
            or name.startswith(("encoder", "time"))
            or name == "rolling_shutter"
        ):
            np.testing.assert_array_equal(effect_ring(typical_switch(name), 50.8).uv, plain)
