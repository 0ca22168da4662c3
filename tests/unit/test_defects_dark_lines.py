"""Dark lines in the wall's photo: cracks drawn on simulated textures, and textures without any."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.measured import WallTexture
from pipeline.machine.scratch import Scratch
from stages.defects import DefectParameters, find_defects
from stages.defects.dark_lines import dark_lines, lies_beside, limit_of_weight
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording, smooth_noise, wall_of

_RADIUS_MM = 25.0
_AZIMUTH = -np.pi + np.arange(720) * np.pi / 360
_PX_MM = 0.15
_AROUND = round(2 * np.pi * _RADIUS_MM / _PX_MM)


def a_wall(seed: int = 0, dents_mm: float = 0.0, length_mm: float = 90.0):
    """Return a wall with noise of .03 mm and, on request, a pit at 45 mm."""
    rng, distance = np.random.default_rng(seed), np.arange(0, length_mm, 0.5)
    noise = smooth_noise(rng, (len(distance), len(_AZIMUTH)), 0.03, 2.0)
    off = ((distance[:, None] - 45) / 6) ** 2 + (_RADIUS_MM * (_AZIMUTH - 0.5) / 6) ** 2
    return wall_of(distance, _AZIMUTH, _RADIUS_MM + noise + dents_mm * np.exp(-off))


def map_of(wall):
    """Return the wall's relief."""
    return smooth_shape_removed(wall.radius_map, DefectParameters())


def picture(seed: int, rows: int = 600, fine: float = 3.0) -> np.ndarray:
    """Return a mottled grey picture (rows, A): patches of 5 mm and of .6 mm, and noise."""
    rng = np.random.default_rng(seed)
    patches = 0.25 * smooth_noise(rng, (rows, _AROUND), 1.0, 33.0)
    grains = 0.12 * smooth_noise(rng, (rows, _AROUND), 1.0, 4.0)
    return 110 * np.exp(patches + grains) + fine * rng.standard_normal((rows, _AROUND))


def drawn(
    grey: np.ndarray,
    row_mm: float,
    azimuth_rad: float,
    turn_deg: float,
    times: float = 0.55,
    wave_mm: float = 0.8,
) -> None:
    """Draw a wavy line 18 mm long and .3 mm wide, ``times`` as bright; it may cross the seam."""
    t = np.linspace(-9, 9, 60)
    side = wave_mm * np.sin(t)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    i = (row_mm + c * t - s * side) / _PX_MM
    j = (azimuth_rad + np.pi) * _RADIUS_MM / _PX_MM + (s * t + c * side) / _PX_MM
    for turn in (-_AROUND, 0, _AROUND):
        line = np.stack([j + turn, i], -1).round().astype(np.int32)
        mask = np.zeros(grey.shape, np.uint8)
        cv2.polylines(mask, [line], False, 1, 2)
        grey[mask > 0] *= times


def photo(grey: np.ndarray) -> WallTexture:
    bgra = np.full((*grey.shape, 4), 255, np.uint8)
    bgra[..., :3] = np.clip(grey, 0, 255)[..., None].astype(np.uint8)
    return WallTexture(bgra, 0.0, _PX_MM, -np.pi, 2 * np.pi / _AROUND)


def found_in(texture: WallTexture, length_mm: float = 90.0) -> list[Region]:
    """Return the dark lines in the photo of a wall of this length."""
    return dark_lines(texture, map_of(a_wall(length_mm=length_mm)), Scratch())


@pytest.mark.parametrize("seed", range(6))
def test_a_wall_without_a_crack_has_no_dark_line(seed: int) -> None:
    assert found_in(photo(picture(seed))) == []


@pytest.mark.parametrize(("azimuth_rad", "turn_deg"), [(0.5, 0.0), (0.5, 90.0), (-2.0, 40.0), (np.pi, 90.0)])
def test_a_crack_is_found_once_where_it_is(azimuth_rad: float, turn_deg: float) -> None:
    grey = picture(3)
    drawn(grey, 45.0, azimuth_rad, turn_deg)
    (line,) = found_in(photo(grey))
    i, j = np.nonzero(line.mask)
    assert 0.5 * (line.row + i.mean()) == pytest.approx(45.0, abs=1.0)
    off = _AZIMUTH[0] + np.radians(0.5) * (line.column + j.mean()) - azimuth_rad
    assert abs((off + np.pi) % (2 * np.pi) - np.pi) * _RADIUS_MM < 1.0
    size = np.hypot(0.5 * line.mask.shape[0], np.radians(0.5) * _RADIUS_MM * line.mask.shape[1])
    assert size == pytest.approx(18.0, abs=2.5)


def test_a_bright_line_is_not_a_crack() -> None:
    grey = picture(3)
    drawn(grey, 45.0, 0.5, 20.0, times=1.6)
    assert found_in(photo(grey)) == []


def test_a_wall_full_of_streaks_has_no_crack() -> None:
    grey, rng = picture(3), np.random.default_rng(5)
    for _ in range(40):
        drawn(grey, rng.uniform(10, 80), rng.uniform(-3, 3), rng.uniform(0, 180), 1 - rng.uniform(-0.5, 0.5))
    assert found_in(photo(grey)) == []


def test_the_edge_of_the_photographed_wall_is_not_a_line() -> None:
    texture = photo(picture(4))
    texture.bgra[200:400, 300:600] = 0
    assert found_in(texture) == []


def test_a_uniformly_grey_photo_has_no_line() -> None:
    assert found_in(photo(np.full((600, _AROUND), 128.0))) == []


def test_a_crack_across_a_cut_of_a_long_photo_is_found_once_at_its_place() -> None:
    grey = picture(6, 2300)
    drawn(grey, 150.0, 0.5, 0.0)  # rows of the photo are cut at 1000 and 2000
    drawn(grey, 299.0, 0.5, 0.0)
    found = found_in(photo(grey), 345.0)
    assert [0.5 * (k.row + k.mask.shape[0] / 2) for k in found] == pytest.approx([150.0, 299.0], abs=1.5)


def test_a_seam_along_a_long_photo_is_one_line() -> None:
    grey = picture(6, 2300)
    grey[:, 700:702] *= 0.55
    (seam,) = found_in(photo(grey), 345.0)
    assert 0.5 * seam.mask.shape[0] == pytest.approx(345.0, abs=10.0)


def test_lines_of_the_photo_beyond_the_map_are_ignored() -> None:
    grey = picture(6, 1200)
    drawn(grey, 140.0, 0.5, 0.0)
    assert found_in(photo(grey)) == []


def test_only_a_line_next_to_a_finding_is_part_of_it() -> None:
    wall = map_of(a_wall())
    line = Region(100, -5, np.ones((1, 20), bool), 1.0)
    assert lies_beside(line, Region(98, 718, np.ones((2, 12), bool), 1.0), wall)
    assert not lies_beside(line, Region(60, 718, np.ones((2, 12), bool), 1.0), wall)
    assert not lies_beside(line, Region(98, 200, np.ones((2, 12), bool), 1.0), wall)


@pytest.mark.parametrize("by_chance", [0.05, 0.01])
@pytest.mark.parametrize("power", [2.0, 4.0, 8.0])
def test_the_limit_of_a_texture_is_exceeded_no_more_often_than_stated(by_chance: float, power: float) -> None:
    rng = np.random.default_rng(0)
    weights = np.sort(rng.pareto(power, (8000, 400)) + 1)[:, ::-1]
    passed = np.mean([w[0] > limit_of_weight(w, by_chance) for w in weights])
    assert 0.4 * by_chance < passed < 1.1 * by_chance


def test_cracks_hardly_change_the_limit_and_few_lines_give_none() -> None:
    rng = np.random.default_rng(0)
    weights = np.sort(rng.pareto(4.0, (300, 400)) + 1)[:, ::-1]
    cracks = np.full(3, 1e3)
    raised = [limit_of_weight(np.append(cracks, w), 0.05) / limit_of_weight(w, 0.05) for w in weights]
    assert np.median(raised) < 1.8
    assert limit_of_weight(weights[0, :39], 0.05) == np.inf


def searched(grey: np.ndarray, dents_mm: float = 0.0):
    wall = a_wall(1, dents_mm)
    return find_defects(
        bare_recording(2 * _RADIUS_MM), wall, photo(grey), DefectParameters(), quiet_context()
    )


def test_a_crack_that_no_ring_shows_is_listed_but_not_counted() -> None:
    grey = picture(3)
    drawn(grey, 45.0, 0.5, 0.0)
    found = searched(grey)
    assert found.items == ()
    (line,) = found.unconfirmed
    assert (line.kind, line.id) == (DefectKind.CRACK, 1)
    assert line.pacp_suggestion.startswith("CL")
    assert line.peak_clock == pytest.approx(3 + np.degrees(0.5) / 30, abs=0.2)
    assert "Only the photo shows it" in line.statement
    assert np.isnan([line.probability, line.confidence]).all()
    assert abs(line.depth_mm) < 3 * line.depth_sigma_mm
    assert len(line.frames) > 20


def test_a_short_straight_crack_keeps_its_code() -> None:
    grey = picture(3)
    drawn(grey, 45.0, 0.5, 90.0, wave_mm=0.0)
    (line,) = searched(grey).unconfirmed
    assert line.pacp_suggestion.startswith("CC")
    assert line.statement.startswith("Dark line")


@pytest.mark.parametrize("along", [True, False])
def test_a_joint_or_a_seam_does_not_get_the_code_of_a_crack(along: bool) -> None:
    grey = picture(3)
    grey[(slice(None), slice(700, 702)) if along else slice(299, 302)] *= 0.5
    (line,) = searched(grey).unconfirmed
    assert line.pacp_suggestion == line.en13508_suggestion == ""
    assert "Straight dark line" in line.statement
    assert line.width_mm < 2 * np.pi * _RADIUS_MM + 1.0
    assert along or (line.clock_from, line.clock_to) == (0.0, 12.0)


def test_a_dark_line_in_a_pit_is_a_part_of_the_pit() -> None:
    grey = picture(3)
    drawn(grey, 45.0, 0.5, 0.0)
    found = searched(grey, dents_mm=1.0)
    assert len(found.items) == 1
    assert found.items[0].depth_mm == pytest.approx(1.0, abs=0.1)
    assert found.unconfirmed == ()
