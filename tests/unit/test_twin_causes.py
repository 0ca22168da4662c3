"""Causes over time and along the line, on synthetic sums of frames.

They are named where they act, and nothing else is.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.instrument.probe import Lighting
from stages.twin.banding import banding_of_line
from stages.twin.causes import _may_be, causes
from stages.twin.cells import SECTORS, Cells, Fitted, Law
from stages.twin.flicker import beside_spots
from stages.twin.laws import led_share, ramps_of
from stages.twin.over_time import beside_reducer
from tests.unit.frame_cells import AZIMUTH_DEG, FRAMES, NUMBER, RING, cells_with, found_in_cells, step_from


def test_nothing_is_found_where_nothing_changes():
    drift = np.linspace(-0.05, 0.05, FRAMES)[:, None]
    uneven = 0.1 * np.cos(np.radians(AZIMUTH_DEG))
    assert [len(found_in_cells(drift + uneven, 3 * drift - uneven, seed)) for seed in range(8)] == [0] * 8


def test_frames_without_any_difference_have_no_cause():
    """The size of the step, 0, was a divisor."""
    same = np.full((FRAMES, SECTORS), 500.0)
    assert causes(Cells(NUMBER, 2 * same, same, same, same, same), None, Lighting(), RING) == ((), ())


def test_an_led_that_fails_is_distinguished_from_a_step():
    away = np.radians(AZIMUTH_DEG - 60)
    share = (1 + 0.3 * np.cos(away) + 0.05 * np.cos(2 * away)) / 8
    (led,) = found_in_cells(np.log1p(-share) * step_from(10))
    assert led.name == "led_dead"
    assert led.place[0].value == 95
    assert led.place[1].value == pytest.approx(60, abs=20)
    assert led.parameters[0].value == pytest.approx(1, abs=0.35)


@pytest.mark.parametrize(("lost", "half_deg", "first"), [(0.3, 60, 6), (0.6, 100, 6), (0.9, 60, 9)])
def test_a_side_that_darkens_in_another_way_than_by_an_led_has_no_name(lost, half_deg, first):
    """Such sides were called flicker, a step of all lamps, or an LED that lost 204 % of its light."""
    away = np.abs((AZIMUTH_DEG - 4 + 180) % 360 - 180)
    lobe = np.cos(np.radians(np.minimum(away * 90 / half_deg, 90))) ** 2
    (side,) = found_in_cells(np.log1p(-lost * lobe) * step_from(first))
    assert (side.name, side.fixed_to) == ("", "time")
    assert side.place[0].value == 10 * first - 5
    assert side.place[1].value == pytest.approx(4, abs=10)
    assert side.parameters[0].value == pytest.approx(lost, abs=0.12)


@pytest.mark.parametrize("azimuth_deg", [-170, 4, 60])
@pytest.mark.parametrize("lost", [0.5, 0.9])
def test_a_side_that_gets_nearly_dark_is_reported_like_one_that_darkens(lost, azimuth_deg):
    """An LED that loses five times its light fitted about as well; then no law at all was reported."""
    side = np.maximum(np.cos(np.radians(AZIMUTH_DEG - azimuth_deg)), 0) ** 2
    (found,) = found_in_cells(np.log1p(-lost * side) * step_from(9))
    assert (found.name, found.fixed_to) == ("", "time")
    assert found.parameters[0].value == pytest.approx(lost, abs=0.1)


@pytest.mark.parametrize(("seed", "lost"), [(23, 0.5), (39, 0.5), (26, 0.4), (37, 0.4)])
def test_an_led_that_noise_seems_to_slow_is_no_step_of_all_lamps(seed, lost, monkeypatch):
    """A step was named: noise made it slow, or a step fitted by a hair better and its rivals were lost."""
    monkeypatch.setattr("tests.unit.frame_cells.FRAMES", 14)
    monkeypatch.setattr("tests.unit.frame_cells.NUMBER", NUMBER[:14])
    share = led_share(Lighting(), np.array([0.3]), RING)
    cells = cells_with(np.log1p(-lost * share) * step_from(7), seed, of_photo=0.03)
    (led,), slow = causes(cells, None, Lighting(), RING)
    assert "led_dead" in led.names
    assert slow == ()


def test_a_side_that_darkens_slowly_is_withdrawn_with_a_reason():
    """Nothing at all was told of it."""
    course = np.clip((np.arange(FRAMES) - 5) / 8, 0, 1)[:, None]
    side = np.maximum(np.cos(np.radians(AZIMUTH_DEG - 20)), 0) ** 2
    found, (slow,) = causes(cells_with(np.log1p(-0.6 * side) * course), None, Lighting(), RING)
    assert found == ()
    assert (slow.name, slow.fixed_to) == ("", "time")
    (at,) = slow.place
    assert at.value == pytest.approx(20, abs=10)
    assert "do not show that it does so at once" in slow.statement


@pytest.mark.parametrize("hidden", [7, 8])
def test_an_led_fails_though_a_frame_beside_it_shows_nothing(hidden):
    """It was refused: sectors were compared in the two frames next to the step alone."""
    share = led_share(Lighting(), np.array([0.3]), RING)
    cells = cells_with(np.log1p(-0.9 * share) * step_from(8))
    pixels = np.where(np.arange(FRAMES)[:, None] == hidden, 10.0, cells.pixels)
    (led,), slow = causes(replace(cells, pixels=pixels), None, Lighting(), RING)
    assert (led.name, slow) == ("led_dead", ())


@pytest.mark.parametrize(("size", "may_be"), [(1.0, True), (1.3, True), (1.7, False)])
def test_an_led_that_loses_far_more_than_its_light_is_none(size, may_be):
    """A side that darkened by half was told as an LED that lost 162 ± 26 % of its light."""
    law = Law("led_dead", np.zeros((1, FRAMES, SECTORS)), np.array([[0.3, 8.0, 0.17]]))
    led = Fitted(law, 0, size, 0.05, 1e-6, np.ones(FRAMES), 2.0, 1.0)
    assert _may_be(led, cells_with(np.zeros((FRAMES, SECTORS))), np.zeros((0, FRAMES, SECTORS))) == may_be


def test_in_few_frames_a_failing_led_may_be_that_or_flicker(monkeypatch):
    monkeypatch.setattr("tests.unit.frame_cells.FRAMES", 6)
    monkeypatch.setattr("tests.unit.frame_cells.NUMBER", NUMBER[:6])
    share = (1 + 0.3 * np.cos(np.radians(AZIMUTH_DEG - 60))) / 8
    (led,) = found_in_cells(np.log1p(-share) * step_from(3))
    assert led.name == "flicker or led_dead"
    assert "6 frames do not distinguish this from an LED that fails" in led.statement
    assert led.place[0].value == 25
    assert led.place[1].value == pytest.approx(60, abs=20)
    (flicker,) = found_in_cells(0.06 * np.random.default_rng(4).standard_normal(6)[:, None])
    assert flicker.name == "flicker"


def test_a_dim_sector_is_found_at_its_place():
    away = np.abs(AZIMUTH_DEG - 45)
    dim = np.log1p(-0.6 / (1 + np.exp((away - 20) / 2)))
    (sector,) = found_in_cells(line=dim[None])
    assert (sector.name, sector.fixed_to) == ("laser_sector", "line")
    assert sector.place[0].value == pytest.approx(45, abs=6)
    assert sector.place[1].value == pytest.approx(40, abs=16)
    assert sector.parameters[0].value == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize("seed", [0, 4])
def test_wall_that_is_paler_in_patches_is_no_dim_sector(seed):
    """Of 60 drawn walls 36 were a dim sector, up to 120° wide: patches were taken for single sectors."""
    patches = gaussian_filter1d(np.random.default_rng(seed).standard_normal(SECTORS), 1.0, mode="wrap")
    assert found_in_cells(line=0.15 * patches[None] / patches.std()) == ()


def test_flicker_of_one_light_is_found():
    each = 0.04 * np.random.default_rng(2).standard_normal(FRAMES)[:, None]
    (flicker,) = found_in_cells(each)
    assert flicker.name == "flicker"
    assert flicker.parameters[0].value == pytest.approx(0.04, abs=0.015)
    (laser,) = found_in_cells(0.0, 2 * each)
    assert laser.name == "laser_flicker"


@pytest.mark.parametrize("frames", [2, 3, 4])
@pytest.mark.parametrize(("light", "lost"), [("lit", 0.12), ("lit", 0.5), ("line", 0.5)])
def test_light_that_fades_over_several_frames_is_no_flicker(light, lost, frames):
    """One LED of eight, or all that fade, was named flicker: an even drift leaves part of it."""
    course = np.clip((np.arange(FRAMES) - 5) / frames, 0, 1)[:, None]
    (slow,) = found_in_cells(**{light: np.log1p(-lost) * course})
    assert (slow.name, slow.fixed_to) == ("", "time")
    assert [p.value for p in slow.place] == pytest.approx([50, 50 + 10 * frames], abs=10)
    assert slow.parameters[0].value == pytest.approx(-lost, abs=0.03)


@pytest.mark.parametrize(("lost", "seed"), [(0.3, 0), (0.12, 0), (0.12, 1)])
def test_a_light_that_fades_between_compared_frames_has_its_place_and_change_within_their_sigma(lost, seed):
    """30 % lost from frame 55 to 85 was told as 199 % brighter from 80 to 170, both with a σ of 0."""
    course = np.clip((np.arange(FRAMES) - 5.5) / 3, 0, 1)[:, None]
    (slow,) = found_in_cells(lit=np.log1p(-lost) * course, seed=seed)
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
    assert not found_in_cells(0.0, (few + 0.004 * random.standard_normal(FRAMES))[:, None])


def test_a_change_of_single_sectors_is_not_flicker():
    random = np.random.default_rng(3)
    assert not found_in_cells(0.04 * random.standard_normal((FRAMES, SECTORS)))


def _bands(size):
    """Return bands along rows (F, S) whose phase differs from frame to frame."""
    row = np.sin(np.radians(AZIMUTH_DEG))
    phase = 2.1 * np.arange(FRAMES)[:, None]
    return np.log1p(size * np.sqrt(2) * np.sin(7 * row + phase))


def test_bands_of_laser_frames_are_named_and_at_most_as_strong_as_drawn():
    """Bands of .11 were missed; a displaced probe and an oval bore are alike on both sides of a row, too."""
    (found,) = (m for m in found_in_cells(line=_bands(0.11)) if m.fixed_to == "rows")
    (size,) = found.parameters
    assert found.name == "banding"
    assert 0.05 < size.value < 0.11 + 2 * size.sd
    assert found.chi2_after < found.chi2_before
    random = np.random.default_rng(4)
    shape = random.standard_normal((FRAMES, 2)) @ np.array([np.sin(np.radians(AZIMUTH_DEG)),
                                                            np.cos(np.radians(2 * AZIMUTH_DEG))])  # fmt: skip
    assert [
        m.name for s in range(6) for m in found_in_cells(line=0.1 * shape, seed=s) if m.fixed_to == "rows"
    ] == []
    turned = np.roll(_bands(0.11), SECTORS // 4, 1)  # along columns
    assert not any(m.fixed_to == "rows" for m in found_in_cells(line=turned))


@pytest.mark.parametrize("at_deg", [90, -90])
def test_a_hole_below_or_above_is_no_banding(at_deg):
    """It is alike on both sides of the picture: 37 % of banding was told of a hole in the wall."""
    away = np.abs((AZIMUTH_DEG - at_deg + 180) % 360 - 180)
    hole = -2.0 * (away < 28) * (np.arange(FRAMES) % 3 == 0)[:, None]
    assert not [m for m in found_in_cells(line=hole) if m.fixed_to == "rows"]


def test_bands_beside_a_strut_are_named():
    """About the sector that varies most and its mirror image half of the picture is left out; with a strut,
    too few sectors were left of any frame, and bands of .11 were never named."""
    line = _bands(0.11)
    line[:, 0] += 0.25 * np.random.default_rng(2).standard_normal(FRAMES)
    cells = cells_with(line, 1002, of_photo=0.05)
    beside = replace(cells, pixels=cells.pixels * (np.arange(SECTORS) != 12))
    assert [m.name for m in banding_of_line(beside, RING)] == ["banding"]


def _told(name, **place):
    at = tuple(NamedFigure(n, v, 1.0) for n, v in place.items())
    size = (NamedFigure("exposure", 0.01, 0.001, "relative"),)
    return Mismatch(name, "intensity", "time", at, size, 0.0, 2.0, 1.0, "Light changes.")


@pytest.mark.parametrize(("narrow_mm", "kept"), [(50.0, 2), (38.0, 1)])
def test_light_that_changes_with_the_bore_is_withdrawn(narrow_mm, kept):
    """In a reducer the laser flickered by 33 %: line and photo fall differently with the distance."""
    found = _told("laser_flicker", frame_from=30.0), _told("led_dead", azimuth_deg=40.0)
    bore = np.repeat(np.linspace(50, narrow_mm, 90)[:, None], 12, 1)
    told, withdrawn = beside_reducer(found, SimpleNamespace(radius_mm=bore))
    assert (len(told), len(withdrawn)) == (kept, 2 - kept)
    assert all("bore varies" in m.statement for m in withdrawn)


@pytest.mark.parametrize(("fixed_to", "name"), [("time", ""), ("image", "flicker")])
def test_flicker_beside_spots_that_come_and_go_has_no_name(fixed_to, name):
    """Particles adrift were flicker of 1.0 %."""
    spots = replace(_told(""), fixed_to=fixed_to)
    assert [m.name for m in beside_spots((_told("flicker"),), (spots,))] == [name]
