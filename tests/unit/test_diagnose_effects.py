"""The library of effects: coverage, quantities that an effect must not change, linearity, sentences."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.physics.catalogue import EFFECTS
from pipeline.physics.effect import FixedTo
from stages.diagnose.effects.base import Travel
from stages.diagnose.effects.library import (
    LIBRARY,
    NOT_PREDICTED,
    columns,
    reading_columns,
    ring_shift_px,
    texture_columns,
    texture_shift_px,
    without,
)
from stages.diagnose.effects.nameless import STEADY, GenericTerm, Moves
from stages.diagnose.effects.vocabulary import GENERIC, VOCABULARY
from tests.unit.effect_points import BORE, known_probe, line, texture
from tests.unit.wall_points import Bore, plain_probe, ring_points

# What an effect on positions or readings must not change.
LEAVES_TEXTURE = {
    "laser_tilt", "laser_cone", "baseline", "beam_decentre", "sheet_waviness", "laser_rocking",
    "baseline_drift", "pixel_locking", "albedo_bias", "subsurface", "line_skew", "vignetting",
}  # fmt: skip
READINGS = {"encoder_scale", "encoder_slip", "encoder_backlash", "time_offset", "motion_blur"}


def travel():
    time = np.linspace(0, 8, 241)
    distance = 20 * np.sin(2 * np.pi * time / 8)
    return Travel(time, distance, 5 * np.pi * np.cos(2 * np.pi * time / 8))


def shape_of(model):
    return model.shapes(8.0, 30.0)[0]


def size_of(model, scale=1.0):
    sizes = np.array([a.plausible for a in model.amplitudes])
    return scale * sizes * np.linspace(1.0, 0.6, len(sizes))


EVERY = [*LIBRARY.values(), *GENERIC]
NAMES = [m.name for m in EVERY]


def test_every_effect_of_the_catalogue_is_predicted_or_listed_as_not_predictable():
    assert set(LIBRARY) | set(NOT_PREDICTED) == set(EFFECTS)
    assert not set(LIBRARY) & set(NOT_PREDICTED)


def test_names_are_unique():
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize("name", LIBRARY)
def test_each_effect_moves_what_it_should_and_nothing_else(name):
    model = LIBRARY[name]
    size, shape = size_of(model), shape_of(model)
    ring = np.abs(ring_shift_px(model, line(), shape, size)).max()
    points = np.abs(texture_shift_px(model, texture(), shape, size)).max()
    reading = np.abs(model.reading_shift_mm(travel(), shape, size)).max()
    assert (ring > 1e-4) == (name not in READINGS)
    assert (points > 1e-4) == (name not in READINGS | LEAVES_TEXTURE)
    assert (reading > 1e-4) == (name in READINGS)


@pytest.mark.parametrize("model", EVERY, ids=NAMES)
def test_amplitude_zero_has_no_effect(model):
    shape, none = shape_of(model), np.zeros(len(model.amplitudes))
    assert np.abs(ring_shift_px(model, line(), shape, none)).max() < 1e-9
    assert np.abs(texture_shift_px(model, texture(), shape, none)).max() < 1e-9
    assert not model.reading_shift_mm(travel(), shape, none).any()


@pytest.mark.parametrize("model", EVERY, ids=NAMES)
def test_columns_are_the_derivative_of_the_prediction(model):
    shape, small = shape_of(model), size_of(model, 1e-3)
    points, off_line = line(), texture()
    ring, wall = columns(model, points, shape) @ small, texture_columns(model, off_line, shape) @ small
    expected_ring = ring_shift_px(model, points, shape, small)
    expected_wall = texture_shift_px(model, off_line, shape, small)
    assert ring == pytest.approx(expected_ring, abs=max(3e-3 * np.abs(expected_ring).max(), 1e-7))
    assert wall == pytest.approx(expected_wall, abs=max(3e-3 * np.abs(expected_wall).max(), 1e-7))


@pytest.mark.parametrize("name", sorted(READINGS))
def test_reading_columns_are_the_derivative_of_the_reading(name):
    model = LIBRARY[name]
    small = size_of(model, 1e-2)
    found = reading_columns(model, travel(), shape_of(model)) @ small
    expected = model.reading_shift_mm(travel(), shape_of(model), small)
    # Play is taken up over its own length, so that frames just after a reversal are not linear in it.
    assert np.median(np.abs(found - expected)) < 0.01 * np.abs(expected).max()


@pytest.mark.parametrize("name", [n for n in LIBRARY if len(LIBRARY[n].amplitudes) > 1])
def test_amplitudes_add_like_vectors(name):
    model = LIBRARY[name]
    shape, points = shape_of(model), line()
    size = size_of(model, 0.1)
    together = ring_shift_px(model, points, shape, size)
    alone = sum(ring_shift_px(model, points, shape, size * part) for part in np.eye(len(size)))
    assert together == pytest.approx(alone, abs=2e-3 * np.abs(together).max())


@pytest.mark.parametrize("name", LIBRARY)
def test_quantities_are_those_of_the_catalogue_within_its_range_and_appear_in_the_sentence(name):
    model = LIBRARY[name]
    shape, size = shape_of(model), size_of(model)
    found = model.quantities(shape, size)
    known = {q.name for q in EFFECTS[name].quantities}
    assert set(found) == known
    assert model.possible(shape, size)
    assert model.statement(shape, size).endswith(".")
    assert all(quantity in model.equation(shape, size) for quantity in found)


def test_a_negative_size_gets_the_opposite_word():
    short = LIBRARY["encoder_scale"].statement((), np.array([-0.0125]))
    assert short == "The encoder reads 1.250% too little of every distance."
    assert "too much" in LIBRARY["encoder_scale"].statement((), np.array([0.0125]))
    for model in LIBRARY.values():
        shape, size = model.shapes(10.0, 30.0)[0], -np.ones(len(model.amplitudes))
        assert not set("[|]") & set(model.statement(shape, size))


def test_a_size_outside_the_catalogues_range_is_not_possible():
    assert not LIBRARY["laser_cone"].possible((), np.array([4.0]))
    assert not LIBRARY["housing_glass"].possible((), np.array([-1.0]))
    assert not LIBRARY["albedo_bias"].possible((), np.array([-0.1]))


@pytest.mark.parametrize(
    ("name", "shape", "amplitude", "direction"),
    [
        ("laser_tilt", (), [0.3, 0.4], np.degrees(np.arctan2(4, 3))),
        ("sheet_waviness", (3.0,), [0.0, 0.5], 30.0),
        ("ovality", (), [-0.1, 0.0], 90.0),
    ],
)
def test_the_direction_is_that_of_a_crest(name, shape, amplitude, direction):
    model = LIBRARY[name]
    found = model.quantities(shape, np.array(amplitude))["direction_deg"]
    assert found == pytest.approx(direction)
    points = ring_points(plain_probe(), Bore(50.8))
    moved = model.sheet_shift_mm(points, shape, np.array(amplitude)) + model.wall_shift_mm(
        points, shape, np.array(amplitude)
    )
    crest = np.argmin(np.abs(points.azimuth_rad - np.radians(direction)))
    assert moved[crest] == pytest.approx(moved.max(), rel=1e-3)


def test_rocking_is_described_by_its_longer_axis():
    along = np.array([np.cos(0.5), np.sin(0.5)])
    amplitude = np.concatenate([3.0 * along, 4.0 * along])
    found = LIBRARY["laser_rocking"].quantities((5.3,), amplitude)
    assert found["amplitude_mrad"] == pytest.approx(5.0)
    assert np.tan(np.radians(found["direction_deg"])) == pytest.approx(np.tan(0.5))
    assert found["frequency_hz"] == 5.3


def test_rocking_frequencies_reach_half_the_frame_rate_in_steps_that_the_recording_resolves():
    frequencies = np.array(LIBRARY["laser_rocking"].shapes(8.0, 30.0))[:, 0]
    assert frequencies[0] <= 1 / 8.0
    assert frequencies[-1] == pytest.approx(15.0, abs=1 / 16)
    assert np.diff(frequencies).max() <= 0.5 / 8.0 + 1e-9


def test_drifts_start_at_zero_and_end_at_their_size():
    model = LIBRARY["baseline_drift"]
    points = replace(line(3), time_s=np.array([0.0, 2.0, 1e4]))
    course = model.sheet_shift_mm(points, (2.0,), np.array([0.1]))
    assert course == pytest.approx([0.0, 0.1 * (1 - np.exp(-1)), 0.1])


def test_with_a_rolling_shutter_lower_rows_are_later():
    points = texture()
    shift = LIBRARY["rolling_shutter"].image_shift_px(points, (), np.array([0.02]))
    assert shift[:, 0] == pytest.approx(0.02 * (points.uv[:, 1] - 599.5) / 1200 * 30.0)


def test_encoder_slip_delay_and_play_change_the_reading_as_defined():
    log = travel()
    slip = LIBRARY["encoder_slip"].reading_shift_mm(log, (4.0,), np.array([3.0]))
    assert set(slip[log.time_s <= 4.0]) == {0.0}
    assert set(slip[log.time_s > 4.0]) == {3.0}
    late = LIBRARY["time_offset"].reading_shift_mm(log, (), np.array([0.1]))
    assert -late == pytest.approx(0.1 * log.speed_mm_s, abs=0.1)
    play = LIBRARY["encoder_backlash"].reading_shift_mm(log, (), np.array([2.0]))
    fast = np.abs(log.speed_mm_s) > 11.0
    assert play[fast] == pytest.approx(-np.sign(log.speed_mm_s[fast]))
    reading = log.distance_mm + play
    waiting = np.abs(log.time_s - 2.05) < 0.05
    assert np.ptp(reading[waiting]) == pytest.approx(0.0, abs=1e-9)


def test_without_known_wall_nothing_is_predicted():
    points = ring_points(known_probe(), BORE)
    assert not ring_shift_px(LIBRARY["albedo_bias"], points, (), np.array([0.09])).any()


def test_ovality_stays_with_the_pipe_when_the_camera_rolls():
    points = line()
    rolled = replace(points, wall_azimuth_rad=points.azimuth_rad + 0.7)
    shift = LIBRARY["ovality"].wall_shift_mm(rolled, (), np.array([0.1, 0.0]))
    assert shift == pytest.approx(0.1 * np.cos(2 * (points.azimuth_rad + 0.7)))


def test_what_hangs_keeps_its_azimuth_in_the_pipe_when_the_probe_rolls():
    """Of a sheet that sagged by .2° while the probe rolled by 290°, the formula was a swing of .17 Hz."""
    (sags,) = (m for m, _ in VOCABULARY if isinstance(m, GenericTerm) and m.hangs and m.exponent == 2)
    (tilts,) = (m for m in GENERIC if (m.moves, m.harmonic, m.exponent) == (Moves.LINE, 1, 2))
    points = line()
    of_wall = np.arctan2(points.normal_c[:, 1], points.normal_c[:, 0])
    roll = np.random.default_rng(1).uniform(0.0, 5.0, len(of_wall))
    seen = ring_shift_px(sags, replace(points, wall_azimuth_rad=of_wall + roll), STEADY, np.array([0.1, 0.0]))
    along, across = (
        ring_shift_px(tilts, points, STEADY, a) for a in (np.array([0.1, 0.0]), np.array([0.0, 0.1]))
    )
    assert seen == pytest.approx(along * np.cos(roll) - across * np.sin(roll), abs=0.05 * np.abs(seen).max())
    assert np.abs(seen - along).max() > 0.5 * np.abs(seen).max()
    # If the probe hardly rolls, what hangs is not told from what is fixed to the probe.
    hardly = replace(points, wall_azimuth_rad=of_wall + 0.1 * roll)
    assert not ring_shift_px(sags, hardly, STEADY, np.array([0.1, 0.0])).any()
    assert sags.goes_with(STEADY)[0] is FixedTo.GRAVITY
    assert "hangs by its weight" in sags.equation(STEADY, np.array([0.1, 0.0]))


def test_a_reduced_library_has_the_remaining_effects():
    fewer = without(["laser_tilt", "ghost_ring"])
    assert set(LIBRARY) - set(fewer) == {"laser_tilt"}
    with pytest.raises(InputError):
        without(["laser_tlit"])


def test_a_skewed_line_moves_rings_as_a_longer_baseline_does():
    points = line()
    skewed, longer = (columns(LIBRARY[name], points, ())[:, 0] for name in ("line_skew", "baseline"))
    assert skewed == pytest.approx(-points.probe.laser.line_sigma_mm * longer)


def test_vignetting_moves_the_line_inward_in_proportion_to_its_variance():
    points = ring_points(plain_probe(), Bore(50.8))
    sigma_px = 0.15 * 50.8 / (22.0**2 + 50.8**2) * 360.0
    shift = LIBRARY["vignetting"].line_shift_px(points, (), np.array([2.0]))
    assert shift == pytest.approx(-2.0 * sigma_px**2 * (50.8 / 22.0) / 360.0, rel=1e-6)
