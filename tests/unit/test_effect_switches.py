"""Effects as switches: the meaning of their text, and that each changes what it should and nothing else."""

from dataclasses import fields, is_dataclass, replace
from inspect import signature

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.physics.catalogue import ALL_EFFECTS as EFFECTS
from pipeline.simulator.effects import EFFECT_FUNCTIONS, switch_on
from pipeline.simulator.effects.surroundings import line_peak
from pipeline.simulator.effects.switch import (
    Switch,
    parse_switch,
    parse_switches,
    switches_from_mapping,
    typical_switch,
)
from pipeline.simulator.laws import bench_truth

# What each effect may change; a change that acts with time is in "changes".
TOUCHES = {
    "laser_tilt": {"instrument.laser.sheet.tilt_x", "instrument.laser.sheet.tilt_y"},
    "laser_cone": {"instrument.laser.sheet.cone_rad"},
    "baseline": {"instrument.laser.sheet.baseline_mm"},
    "beam_decentre": {
        "instrument.laser.sheet.decentre_x_mm",
        "instrument.laser.sheet.decentre_y_mm",
        "instrument.laser.brightness",
    },
    "sheet_waviness": {"instrument.laser.waves"},
    "laser_rocking": {"changes"},
    "principal_point": {"instrument.camera.model.centre"},
    "focal_scale": {"instrument.camera.model.focal_px"},
    "radial_distortion": {"instrument.camera.model.distortion"},
    "sensor_tilt": {"instrument.camera.decentring"},
    "pixel_aspect": {"instrument.camera.aspect"},
    "pupil_shift": {"instrument.camera.pupil_shift_mm"},
    "rolling_shutter": {"instrument.shutter.kind", "instrument.shutter.readout_s"},
    "motion_blur": {"instrument.shutter.exposure_s", "rendering"},
    "baseline_drift": {"changes"},
    "focal_drift": {"changes"},
    "centre_drift": {"changes"},
    "pixel_locking": {"instrument.camera.locking_px"},
    "housing_glass": {"instrument.camera.windows", "instrument.laser.windows"},
    "tube_wedge": {"instrument.camera.windows", "instrument.laser.windows"},
    "tube_tilt": {"instrument.camera.windows", "instrument.laser.windows"},
    "dome_axial": {"instrument.camera.windows"},
    "dome_lateral": {"instrument.camera.windows"},
    "outside_index": {"instrument.camera.windows", "instrument.laser.windows"},
    "pipe_bend": {"wall.axis.distance_mm", "wall.axis.origin_p", "wall.axis.R_pa"},
    "ovality": {"wall.radius_mm"},
    "probe_vibration": {"motion.x_mm.waves", "motion.y_mm.waves"},
    "encoder_scale": {"odometer.scale"},
    "encoder_slip": {"odometer.slips"},
    "encoder_backlash": {"odometer.backlash_mm"},
    "time_offset": {"odometer.delay_s"},
    "albedo_bias": {"instrument.laser.profile.sigma_mm"},
    "slope_bias": {"wall.gloss"},
    "subsurface": {"instrument.laser.profile.transport_mm"},
    "ghost_ring": {"instrument.laser.ghost_relative"},
    "tube_ghost": {"instrument.laser.profile.copy_relative", "instrument.laser.profile.copy_mm"},
    "line_skew": {"instrument.laser.profile.skewness"},
    "speckle": {"instrument.laser.speckle_contrast"},
    "saturation": {"instrument.laser.power_mm"},
    "gamma": {"instrument.sensor.gamma"},
    "vignetting": {"instrument.sensor.vignetting"},
    "ambient_light": {"instrument.sensor.ambient"},
    "fixed_pattern": {"instrument.sensor.fixed_pattern"},
    "dust": {"instrument.sensor.dust"},
    "light_flicker": {"instrument.flicker.relative", "instrument.flicker.frequency_hz"},
    "led_dead": {"instrument.light.pattern"},
    "laser_sector": {"instrument.laser.sectors"},
    "bloom": {"instrument.sensor.bloom_relative"},
    "black_level": {"instrument.sensor.black_level"},
    "defocus": {"instrument.sensor.psf_sigma_px", "instrument.sensor.psf_edge_px"},
    "window_scatter": {"instrument.sensor.scatter"},
    "droplet": {"instrument.sensor.drops"},
    "defective_pixels": {"instrument.sensor.defective_share", "instrument.sensor.hot_level"},
    "read_noise": {"instrument.sensor.read_noise_e"},
    "full_well": {"instrument.sensor.full_well_e"},
    "dark_pattern": {"instrument.sensor.dark_pattern"},
    "interreflection": {"wall.interreflection"},
}


def changed(before: object, after: object, path: str = "") -> set[str]:
    """Return the dotted names of all fields in which two dataclasses differ."""
    if is_dataclass(before) and type(before) is type(after):
        names = [f.name for f in fields(before)]
        parts = (changed(getattr(before, n), getattr(after, n), f"{path}.{n}") for n in names)
        return set().union(*parts)
    same = np.array_equal(before, after) if isinstance(before, np.ndarray) else before == after
    return set() if same else {path.lstrip(".")}


@st.composite
def switches(draw: st.DrawFn) -> Switch:
    effect = EFFECTS[draw(st.sampled_from(sorted(EFFECTS)))]
    values = tuple(
        float(draw(st.integers(int(q.low), int(q.high))))
        if q.name == "order"
        else draw(st.floats(q.low, q.high, allow_nan=False))
        for q in effect.quantities
    )
    return Switch(effect.name, values)


def test_every_known_effect_has_a_switch_that_takes_its_quantities() -> None:
    assert set(EFFECT_FUNCTIONS) == set(EFFECTS) == set(TOUCHES)
    for name, function in EFFECT_FUNCTIONS.items():
        assert list(signature(function).parameters)[1:] == [q.name for q in EFFECTS[name].quantities]


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_an_effect_changes_what_it_should_and_nothing_else(name: str) -> None:
    plain = bench_truth(50.8)
    assert changed(plain, switch_on(plain, [typical_switch(name)])) == TOUCHES[name]


def test_an_exposure_that_ends_after_the_start_of_the_next_frame_is_refused() -> None:
    plain = bench_truth(50.8)
    own, frame_s = plain.stated.shutter.exposure_s, 1 / plain.frame_rate
    longest = switch_on(plain, [Switch("motion_blur", (frame_s - own - 1e-6,))])
    assert longest.instrument.shutter.exposure_s == pytest.approx(frame_s, abs=2e-6)
    with pytest.raises(InputError, match="longer than a frame"):
        switch_on(plain, [Switch("motion_blur", (frame_s - own + 1e-3,))])


# Effects for which zero means absent, not a surface, a wave or a setting that does nothing.
NOTHING_AT_ZERO = (
    "laser_tilt", "laser_cone", "baseline", "beam_decentre", "laser_rocking", "principal_point",
    "focal_scale", "radial_distortion", "sensor_tilt", "pixel_aspect", "pupil_shift", "baseline_drift",
    "focal_drift", "centre_drift", "pixel_locking", "pipe_bend", "ovality", "encoder_scale",
    "encoder_backlash", "time_offset", "slope_bias", "subsurface", "ghost_ring", "line_skew", "speckle",
    "vignetting", "ambient_light", "fixed_pattern", "read_noise", "dark_pattern",
    "interreflection",
)  # fmt: skip


@pytest.mark.parametrize("name", NOTHING_AT_ZERO)
def test_an_effect_of_size_zero_changes_nothing_at_any_time(name: str) -> None:
    sizes = [q.typical for q in EFFECTS[name].quantities]
    plain = bench_truth(50.8)
    truth = switch_on(plain, [Switch(name, (0.0, *sizes[1:]))])
    assert changed(replace(plain, changes=()), replace(truth, changes=())) == set()
    for time_s in (0.0, 3.7):
        assert changed(plain.instrument_at(time_s), truth.instrument_at(time_s)) == set()


@given(switches())
def test_a_switch_reads_back_from_its_text(switch: Switch) -> None:
    assert parse_switch(switch.text) == switch


@given(switches())
def test_a_switch_reads_back_from_a_scene_file(switch: Switch) -> None:
    assert switches_from_mapping({switch.name: switch.quantities}, "scene.yaml") == (switch,)


@given(st.text(max_size=30))
def test_any_other_text_is_refused_as_bad_input(text: str) -> None:
    for start in ("", "laser_tilt=", "sheet_waviness=0.3"):
        try:
            switch = parse_switch(start + text)
        except InputError:
            continue
        assert switch.name in EFFECTS


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("laser_tilt=0.6@40", (0.6, 40.0)),
        ("laser_tilt=0.6deg@40", (0.6, 40.0)),
        ("laser_tilt", (0.05, 40.0)),
        ("laser_tilt=.6", (0.6, 40.0)),
        ("laser_cone=-5e-2", (-0.05,)),
        ("baseline_drift=0.05/40s", (0.05, 40.0)),
        ("laser_rocking=1@40/5.3Hz", (1.0, 5.3, 40.0)),
        ("laser_rocking=1/5.3Hz@40", (1.0, 5.3, 40.0)),
        ("sheet_waviness=0.3x2@30", (0.3, 2.0, 30.0)),
        ("principal_point=0.5px@-120", (0.5, -120.0)),
        ("centre_drift=0.5@10/30s", (0.5, 10.0, 30.0)),
        ("tube_ghost=0.01/-1.1mm", (0.01, -1.1)),
        ("encoder_slip=-3/4s", (-3.0, 4.0)),
        ("dust=0.4@60/4deg", (0.4, 60.0, 4.0)),
    ],
)
def test_texts_of_the_documentation(text: str, values: tuple[float, ...]) -> None:
    assert parse_switch(text).values == values


@pytest.mark.parametrize(
    "text",
    [
        "laser_tlit=0.6", "laser_tilt=", "laser_tilt=@40", "laser_tilt=0.6@40@50", "laser_tilt=0.6/40s",
        "laser_tilt=0.6mm@40", "laser_tilt=9@40", "laser_tilt=nan@40", "laser_tilt=0.6@",
        "laser_tilt=0.6 @40", "baseline_drift=0.05/40", "baseline_drift=0.05@40", "sheet_waviness=0.3x2.5",
        "sheet_waviness=0.3x9", "ghost_ring=2", "encoder_slip=3/-4s",
    ],
)  # fmt: skip
def test_a_wrong_text_is_refused_and_the_error_says_what_is_expected(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_switch(text)
    name = text.partition("=")[0]
    for quantity in EFFECTS[name].quantities if name in EFFECTS else ():
        assert quantity.name in str(caught.value)
        assert f"{quantity.low:g} to {quantity.high:g}" in str(caught.value)


def test_wrong_scene_files_are_refused_with_the_place_of_the_error() -> None:
    wrong: tuple[object, ...] = (
        ["laser_tilt"],
        {"laser_tilt": 0.6},
        {"laser_tilt": {"angle": 1.0}},
        {"laser_tilt": {"tilt_deg": "0.6"}},
        {"laser_tilt": {"tilt_deg": True}},
    )
    for effects in wrong:
        with pytest.raises(InputError, match=r"effects"):
            switches_from_mapping(effects, "scene.yaml")


def test_an_effect_may_not_be_given_twice() -> None:
    with pytest.raises(InputError, match="twice"):
        parse_switches(["laser_tilt=0.6@40", "laser_tilt=0.1@10"])


def test_the_truth_lists_names_and_values() -> None:
    assert parse_switch("laser_tilt=0.6@40").truth == ["laser_tilt", [0.6, 40.0]]


def test_effects_combine_in_any_order() -> None:
    texts = ["outside_index=0.333", "laser_tilt=0.6@40", "housing_glass=2", "baseline=0.1", "dome_axial=0.5"]
    plain = bench_truth(50.8)
    one, other = (switch_on(plain, parse_switches(t)) for t in (texts, texts[::-1]))
    assert changed(one, other) == set()
    assert [w.index_beyond for w in one.instrument.camera.windows] == [1.5, 1.0, 1.5, 1.0, 1.333]


def test_a_drift_starts_at_the_first_frame_and_ends_at_its_size() -> None:
    plain = bench_truth(50.8)
    truth = switch_on(plain, parse_switches(["baseline_drift=0.05/40s"]))
    grown = [truth.instrument_at(t).laser.sheet.baseline_mm - 22 for t in (-5.0, 0.0, 40.0, 4000.0)]
    np.testing.assert_allclose(grown, [0, 0, 0.05 * (1 - np.exp(-1)), 0.05], atol=1e-12)


def test_rocking_returns_after_a_period_and_is_opposite_after_half() -> None:
    truth = switch_on(bench_truth(50.8), parse_switches(["laser_rocking=1@40/5Hz"]))
    tilt = [truth.instrument_at(t).laser.sheet.tilt_x for t in (0.0, 0.05, 0.15, 0.25)]
    crest = np.tan(1e-3) * np.cos(np.radians(40))
    np.testing.assert_allclose(tilt, [0, crest, -crest, crest], atol=1e-9)


def test_encoder_effects_need_an_encoder() -> None:
    without = replace(bench_truth(50.8), odometer=None)
    for name in ("encoder_scale", "encoder_slip", "encoder_backlash", "time_offset"):
        with pytest.raises(InputError, match="encoder"):
            switch_on(without, [typical_switch(name)])


def test_saturation_sets_the_peak_whatever_it_was_before() -> None:
    for also in ([], ["line_skew=0.8"], ["albedo_bias=0.3"]):
        truth = switch_on(bench_truth(38.1), parse_switches(["saturation=1.6", *also]))
        assert line_peak(truth) == pytest.approx(1.6)
