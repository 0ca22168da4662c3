"""Causes over time and along the line, on synthetic sums of frames.

They are named where they act, and nothing else is.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from pipeline.instrument.probe import Lighting
from stages.twin import causes as of_time
from stages.twin.causes import _at_once_first, _may_be, causes
from stages.twin.cells import SECTORS, Cells, CellsOfFrames, Fitted, Law, sector_azimuth_rad, sectors_of
from stages.twin.laws import led_share, ramps_of
from stages.twin.line_light import _plain_line
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.sums import Sums

RING, FRAMES = Ring((400.0, 300.0), 200.0, 50.0, 23.0), 18
NUMBER = 10 * np.arange(FRAMES)
AZIMUTH_DEG = np.degrees(sector_azimuth_rad())


def _cells(change, seed=0, of_photo=0.01):
    """Return cells with noise of 1 σ per pixel, a photo error in each cell, and a logarithmic change."""
    random = np.random.default_rng(seed)
    pixels, level = 500.0, 20.0
    photo = of_photo * random.standard_normal((FRAMES, SECTORS))
    ratio = np.exp(photo + change) + random.standard_normal((FRAMES, SECTORS)) / (level * np.sqrt(pixels))
    own = np.full((FRAMES, SECTORS), pixels * level**2)
    square = pixels * (1 + (ratio * level) ** 2)
    return Cells(
        NUMBER, square, ratio * own, own, np.full_like(own, pixels), np.full_like(own, pixels * level)
    )


def _found(lit=0.0, line=0.0, seed=0):
    zero = np.zeros((FRAMES, SECTORS))
    return causes(
        _cells(zero + lit, seed), _cells(zero + line, seed + 1000, of_photo=0.05), Lighting(), RING
    )[0]


def _step(first):
    return (np.arange(FRAMES) >= first)[:, None].astype(float)


def test_nothing_is_found_where_nothing_changes():
    drift = np.linspace(-0.05, 0.05, FRAMES)[:, None]
    uneven = 0.1 * np.cos(np.radians(AZIMUTH_DEG))
    assert [len(_found(drift + uneven, 3 * drift - uneven, seed)) for seed in range(8)] == [0] * 8


@pytest.mark.parametrize(
    ("lit", "line", "name"),
    [(0.2, 0.2, "exposure_step"), (0.2, 0.0, "lamp_step"), (0.0, -0.3, "laser_step")],
)
def test_a_step_is_attributed_to_the_exposure_or_to_one_light(lit, line, name):
    (step,) = _found(lit * _step(8), line * _step(8))
    assert (step.name, step.fixed_to) == (name, "time")
    assert step.place[0].value == 75
    assert step.parameters[0].value == pytest.approx(np.expm1(lit or line), abs=4 * step.parameters[0].sd)
    assert step.chi2_after < step.chi2_before


@pytest.mark.parametrize("azimuth_deg", [-170, -60, 10, 80])
def test_darker_wall_on_one_side_of_the_last_frames_is_not_a_step_of_the_laser(azimuth_deg):
    """Corrosion on one side that two frames at the end saw was reported as a laser 7 % darker."""
    away = np.abs((AZIMUTH_DEG - azimuth_deg + 180) % 360 - 180)
    wall = -0.17 * (away < 80) * (np.arange(FRAMES) >= FRAMES - 2)[:, None]
    assert not any("step" in m.name for seed in range(4) for m in _found(0.0, wall, seed))


def test_frames_without_any_difference_have_no_cause():
    """The size of the step, 0, was a divisor."""
    same = np.full((FRAMES, SECTORS), 500.0)
    assert causes(Cells(NUMBER, 2 * same, same, same, same, same), None, Lighting(), RING) == ((), ())


def _of_line(change, predicted=1.0, hidden=0):
    """Return the names found in the line, with some sectors hidden, beside lit frames without a change."""
    cells = _cells(np.zeros((FRAMES, SECTORS)) + change, 1000, of_photo=0.05)
    pixels = np.where(np.arange(SECTORS) < hidden, 30.0, cells.pixels)
    cells = replace(cells, pixels=pixels, predicted=cells.predicted * predicted)
    return [m.name for m in causes(_cells(np.zeros((FRAMES, SECTORS))), cells, Lighting(), RING)[0]]


def test_a_step_is_found_though_half_of_the_picture_is_not_seen():
    """A half without usable sectors did not step, so that no step was reported."""
    assert _of_line(-0.3 * _step(8), hidden=18) == ["laser_step"]
    assert _of_line(-0.3 * _step(8), hidden=22) == ["laser_step or other_wall"]


def test_darker_wall_on_two_thirds_of_the_picture_is_not_a_step_of_the_laser():
    """In 2 of 3 cases it was one: the other third was compared with the mean, not with its opposite."""
    wall = -0.3 * (np.abs(AZIMUTH_DEG - 20) < 120) * _step(FRAMES - 3)
    assert not any("step" in m.name for seed in range(3) for m in _found(0.0, wall, seed))


def test_a_step_of_the_laser_where_the_photo_steps_too_may_be_other_wall():
    """Wall darker all round from a frame on was reported with certainty as a laser that loses power."""
    random = np.random.default_rng(2)
    texture = np.exp(
        0.03 * random.standard_normal((FRAMES, 1)) + 0.1 * random.standard_normal((FRAMES, SECTORS))
    )
    assert _of_line(-0.3 * _step(12), texture) == ["laser_step"]
    for wall in (-0.2, 0.3):
        assert _of_line(-0.3 * _step(12), texture * np.exp(wall * _step(12))) == ["laser_step or other_wall"]


def test_the_sigma_of_a_step_is_right_beside_an_error_that_changes_slowly():
    inside = 0
    for phase in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        slow = 0.003 * np.sin(np.arange(FRAMES) / 2.5 + phase)[:, None]
        both = (_cells(np.log(1.06) * _step(8) + slow + np.zeros(SECTORS), k, 0.001) for k in (0, 1))
        (step,) = causes(*both, Lighting(), RING)[0]
        inside += abs(step.parameters[0].value - 0.06) < 2 * step.parameters[0].sd
    assert inside >= 11


def test_an_led_that_fails_is_distinguished_from_a_step():
    away = np.radians(AZIMUTH_DEG - 60)
    share = (1 + 0.3 * np.cos(away) + 0.05 * np.cos(2 * away)) / 8
    (led,) = _found(np.log1p(-share) * _step(10))
    assert led.name == "led_dead"
    assert led.place[0].value == 95
    assert led.place[1].value == pytest.approx(60, abs=20)
    assert led.parameters[0].value == pytest.approx(1, abs=0.35)


@pytest.mark.parametrize(("lost", "half_deg", "first"), [(0.3, 60, 6), (0.6, 100, 6), (0.9, 60, 9)])
def test_a_side_that_darkens_in_another_way_than_by_an_led_has_no_name(lost, half_deg, first):
    """Such sides were called flicker, a step of all lamps, or an LED that lost 204 % of its light."""
    away = np.abs((AZIMUTH_DEG - 4 + 180) % 360 - 180)
    lobe = np.cos(np.radians(np.minimum(away * 90 / half_deg, 90))) ** 2
    (side,) = _found(np.log1p(-lost * lobe) * _step(first))
    assert (side.name, side.fixed_to) == ("", "time")
    assert side.place[0].value == 10 * first - 5
    assert side.place[1].value == pytest.approx(4, abs=10)
    assert side.parameters[0].value == pytest.approx(lost, abs=0.12)


@pytest.mark.parametrize("azimuth_deg", [-170, 4, 60])
@pytest.mark.parametrize("lost", [0.5, 0.9])
def test_a_side_that_gets_nearly_dark_is_reported_like_one_that_darkens(lost, azimuth_deg):
    """An LED that loses five times its light fitted about as well; then no law at all was reported."""
    side = np.maximum(np.cos(np.radians(AZIMUTH_DEG - azimuth_deg)), 0) ** 2
    (found,) = _found(np.log1p(-lost * side) * _step(9))
    assert (found.name, found.fixed_to) == ("", "time")
    assert found.parameters[0].value == pytest.approx(lost, abs=0.1)


@pytest.mark.parametrize(("seed", "lost"), [(23, 0.5), (39, 0.5), (26, 0.4), (37, 0.4)])
def test_an_led_that_noise_seems_to_slow_is_no_step_of_all_lamps(seed, lost, monkeypatch):
    """A step was named: noise made it slow, or a step fitted by a hair better and its rivals were lost."""
    monkeypatch.setattr("tests.unit.test_twin_causes.FRAMES", 14)
    monkeypatch.setattr("tests.unit.test_twin_causes.NUMBER", NUMBER[:14])
    share = led_share(Lighting(), np.array([0.3]), RING)
    cells = _cells(np.log1p(-lost * share) * _step(7), seed, of_photo=0.03)
    (led,), slow = causes(cells, None, Lighting(), RING)
    assert "led_dead" in led.names
    assert slow == ()


def test_a_side_that_darkens_slowly_is_withdrawn_with_a_reason():
    """Nothing at all was told of it."""
    course = np.clip((np.arange(FRAMES) - 5) / 8, 0, 1)[:, None]
    side = np.maximum(np.cos(np.radians(AZIMUTH_DEG - 20)), 0) ** 2
    found, (slow,) = causes(_cells(np.log1p(-0.6 * side) * course), None, Lighting(), RING)
    assert found == ()
    assert (slow.name, slow.fixed_to) == ("", "time")
    (at,) = slow.place
    assert at.value == pytest.approx(20, abs=10)
    assert "do not show that it does so at once" in slow.statement


@pytest.mark.parametrize("hidden", [7, 8])
def test_an_led_fails_though_a_frame_beside_it_shows_nothing(hidden):
    """It was refused: sectors were compared in the two frames next to the step alone."""
    share = led_share(Lighting(), np.array([0.3]), RING)
    cells = _cells(np.log1p(-0.9 * share) * _step(8))
    pixels = np.where(np.arange(FRAMES)[:, None] == hidden, 10.0, cells.pixels)
    (led,), slow = causes(replace(cells, pixels=pixels), None, Lighting(), RING)
    assert (led.name, slow) == ("led_dead", ())


@pytest.mark.parametrize(("size", "may_be"), [(1.0, True), (1.3, True), (1.7, False)])
def test_an_led_that_loses_far_more_than_its_light_is_none(size, may_be):
    """A side that darkened by half was told as an LED that lost 162 ± 26 % of its light."""
    law = Law("led_dead", np.zeros((1, FRAMES, SECTORS)), np.array([[0.3, 8.0, 0.17]]))
    led = Fitted(law, 0, size, 0.05, 1e-6, np.ones(FRAMES), 2.0, 1.0)
    assert _may_be(led, _cells(np.zeros((FRAMES, SECTORS))), np.zeros((0, FRAMES, SECTORS))) == may_be


def test_in_few_frames_a_failing_led_may_be_that_or_flicker(monkeypatch):
    monkeypatch.setattr("tests.unit.test_twin_causes.FRAMES", 6)
    monkeypatch.setattr("tests.unit.test_twin_causes.NUMBER", NUMBER[:6])
    share = (1 + 0.3 * np.cos(np.radians(AZIMUTH_DEG - 60))) / 8
    (led,) = _found(np.log1p(-share) * _step(3))
    assert led.name == "flicker or led_dead"
    assert "6 frames do not distinguish this from an LED that fails" in led.statement
    assert led.place[0].value == 25
    assert led.place[1].value == pytest.approx(60, abs=20)
    (flicker,) = _found(0.06 * np.random.default_rng(4).standard_normal(6)[:, None])
    assert flicker.name == "flicker"


def test_a_dim_sector_is_found_at_its_place():
    away = np.abs(AZIMUTH_DEG - 45)
    dim = np.log1p(-0.6 / (1 + np.exp((away - 20) / 2)))
    (sector,) = _found(line=dim[None])
    assert (sector.name, sector.fixed_to) == ("laser_sector", "line")
    assert sector.place[0].value == pytest.approx(45, abs=6)
    assert sector.place[1].value == pytest.approx(40, abs=16)
    assert sector.parameters[0].value == pytest.approx(0.6, abs=0.1)


def test_flicker_of_one_light_is_found():
    each = 0.04 * np.random.default_rng(2).standard_normal(FRAMES)[:, None]
    (flicker,) = _found(each)
    assert flicker.name == "flicker"
    assert flicker.parameters[0].value == pytest.approx(0.04, abs=0.015)
    (laser,) = _found(0.0, 2 * each)
    assert laser.name == "laser_flicker"


@pytest.mark.parametrize("frames", [2, 3, 4])
@pytest.mark.parametrize(("light", "lost"), [("lit", 0.12), ("lit", 0.5), ("line", 0.5)])
def test_light_that_fades_over_several_frames_is_no_flicker(light, lost, frames):
    """One LED of eight, or all that fade, was named flicker: an even drift leaves part of it."""
    course = np.clip((np.arange(FRAMES) - 5) / frames, 0, 1)[:, None]
    (slow,) = _found(**{light: np.log1p(-lost) * course})
    assert (slow.name, slow.fixed_to) == ("", "time")
    assert [p.value for p in slow.place] == pytest.approx([50, 50 + 10 * frames], abs=10)
    assert slow.parameters[0].value == pytest.approx(-lost, abs=0.03)


@pytest.mark.parametrize(("lost", "seed"), [(0.3, 0), (0.12, 0), (0.12, 1)])
def test_a_light_that_fades_between_compared_frames_has_its_place_and_change_within_their_sigma(lost, seed):
    """30 % lost from frame 55 to 85 was told as 199 % brighter from 80 to 170, both with a σ of 0."""
    course = np.clip((np.arange(FRAMES) - 5.5) / 3, 0, 1)[:, None]
    (slow,) = _found(lit=np.log1p(-lost) * course, seed=seed)
    ends = [int(place.value) // 10 for place in slow.place]
    for place, true in zip(slow.place, (55, 85), strict=True):
        assert abs(place.value - true) <= 2 * place.sd <= 10
    change, between = slow.parameters[0], course[ends[1], 0] - course[ends[0], 0]
    assert abs(change.value - np.expm1(np.log1p(-lost) * between)) < 3 * change.sd < 0.1


def test_slow_changes_are_searched_in_many_frames_with_little_memory():
    """In 300 frames of one light they took 3 GB, and in the 500 that may be asked for 13 GB."""
    columns, first, last = ramps_of(300)
    assert columns.nbytes < 1.5e8
    assert {(f, f + 1) for f in range(299)} <= set(zip(first, last, strict=True))
    assert len(np.unique(first)) == 299
    assert len(ramps_of(18)[0]) == 17 + sum(16 - k for k in range(2, 10))


def test_welds_seen_by_a_few_frames_are_not_flicker():
    random, few = np.random.default_rng(2), np.zeros(FRAMES)
    few[[4, 5, FRAMES // 2, FRAMES // 2 + 1]] = 0.2, 0.15, -0.25, -0.2
    assert not _found(0.0, (few + 0.004 * random.standard_normal(FRAMES))[:, None])


def test_a_change_of_single_sectors_is_not_flicker():
    random = np.random.default_rng(3)
    assert not _found(0.04 * random.standard_normal((FRAMES, SECTORS)))


def test_sectors_begin_at_minus_pi():
    phi = sector_azimuth_rad().astype(np.float32)
    np.testing.assert_array_equal(sectors_of(phi), np.arange(SECTORS))


def test_a_displaced_line_is_not_darker():
    across = np.arange(-12.0, 13.0)[:, None] + np.zeros(360)
    sector = np.tile(np.arange(360) // 10, (25, 1))
    level = (100 * np.exp(-0.5 * across**2)).astype(np.float32)
    unknown = np.full(level.shape, np.nan, np.float32)
    region = np.where(np.abs(across) < 8, Region.LINE_CORE, Region.DARK).astype(np.uint8)
    twin = TwinFrame(level, np.full_like(level, 2.0), region, unknown, unknown)
    taken = CellsOfFrames()
    for shift in (0.0, 2.0):
        recorded = (80 * np.exp(-0.5 * (across - shift) ** 2)).astype(np.float32)
        taken.add_line(0, recorded, twin, np.inf, sector)
    np.testing.assert_allclose(taken.cells().log_ratio, np.log(0.8), atol=1e-3)


def test_light_beside_the_line_is_none_of_the_laser():
    """Lamps that stay on from the middle of a run on were a laser that gains 167 %."""
    random = np.random.default_rng(1)
    across = np.arange(-12.0, 13.0)[:, None] + np.zeros(720)
    sector = np.tile(np.arange(720) // 20, (25, 1))
    level = (30 * np.exp(-0.5 * across**2)).astype(np.float32)
    unknown = np.full(level.shape, np.nan, np.float32)
    region = np.where(np.abs(across) < 2, Region.LINE_CORE, Region.LINE_FLANK).astype(np.uint8)
    taken = CellsOfFrames()
    for frame in range(16):
        light = 20.0 if frame >= 8 else 0.0
        seen = np.round(level + light + random.standard_normal(level.shape)).astype(np.float32)
        taken.add_line(
            frame, seen, TwinFrame(level, np.ones_like(level), region, unknown, unknown), 250, sector
        )
    ratio = taken.cells().log_ratio
    assert abs(ratio[8:].mean() - ratio[:8].mean()) < 0.01
    assert ratio.std() < 0.05


def test_a_dim_sector_has_the_right_depth_and_width_though_the_rendered_line_contains_it():
    """One of .8 over 20° was .988 ± .085 over 10°: the rendered power falls between the sectors' middles."""
    degree = np.arange(-180.0, 180.0, 0.5) + 0.25
    sector = np.tile((degree + 180).astype(int) // 10, (3, 1))
    left = np.where(np.abs(degree - 60) < 10, 0.2, 1.0)
    even = np.full(sector.shape, 100.0, np.float32)
    line = replace(_plain_line(0.2, 0.8), log_power=np.log(left.reshape(SECTORS, -1).mean(1)))
    power = map_coordinates(line.log_power, [(degree + 180) / 10 - 0.5], order=1, mode="grid-wrap")
    level, unknown = (even * np.exp(power)).astype(np.float32), np.full(sector.shape, np.nan, np.float32)
    region = np.full(sector.shape, Region.LINE_CORE, np.uint8)
    taken = CellsOfFrames()
    for frame in range(8):
        twin = TwinFrame(level, np.full_like(level, 2.0), region, unknown, unknown)
        taken.add_line(frame, (even * left).astype(np.float32), twin, np.inf, sector)
    state = SimpleNamespace(line_is_clipped=False, lamp=None, line=line)
    _, cells = Sums.cells(SimpleNamespace(_state=state, lit=CellsOfFrames(), line=taken))
    np.testing.assert_allclose(cells.log_ratio[0], np.log(left.reshape(SECTORS, -1).mean(1)), atol=0.05)


def _bands(size):
    """Return bands along rows (F, S) whose phase differs from frame to frame."""
    row = np.sin(np.radians(AZIMUTH_DEG))
    phase = 2.1 * np.arange(FRAMES)[:, None]
    return np.log1p(size * np.sqrt(2) * np.sin(7 * row + phase))


def test_bands_of_laser_frames_are_named_and_at_most_as_strong_as_drawn():
    """Bands of .11 were missed; a displaced probe and an oval bore are alike on both sides of a row, too."""
    (found,) = (m for m in _found(line=_bands(0.11)) if m.fixed_to == "rows")
    (size,) = found.parameters
    assert found.name == "banding"
    assert 0.05 < size.value < 0.11 + 2 * size.sd
    assert found.chi2_after < found.chi2_before
    random = np.random.default_rng(4)
    shape = random.standard_normal((FRAMES, 2)) @ np.array([np.sin(np.radians(AZIMUTH_DEG)),
                                                            np.cos(np.radians(2 * AZIMUTH_DEG))])  # fmt: skip
    assert [m.name for s in range(6) for m in _found(line=0.1 * shape, seed=s) if m.fixed_to == "rows"] == []
    turned = np.roll(_bands(0.11), SECTORS // 4, 1)  # along columns
    assert not any(m.fixed_to == "rows" for m in _found(line=turned))


@pytest.mark.parametrize(("better_by", "kept"), [(1.0, ["step"]), (40.0, ["led_dead", "step"])])
def test_a_side_that_should_darken_at_once_and_does_not_hides_no_step_that_fits_as_well(
    better_by, kept, monkeypatch
):
    """A step of exposure under both lights, 10 %, was missed: an LED fitted by a thousandth better."""
    fall = 100 + 10 * np.random.default_rng(3).standard_normal(FRAMES)
    step, led = (
        Fitted(Law(name, np.zeros((1, 1, 1)), np.zeros((1, 3))), 0, -0.1, 0.001, 1e-9, each, 1.0, 0.9)
        for name, each in (("step", fall), ("led_dead", fall[::-1] + better_by))
    )
    monkeypatch.setattr(of_time, "_at_once", lambda found, cells: found.law.name == "step")
    assert [f.law.name for f in _at_once_first([led, step], None)] == kept
