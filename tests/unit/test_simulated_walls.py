"""Walls of simulated pipes: the grid contains what the scene describes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.geometry.axis import from_pipe
from pipeline.simulator.wall import build_wall, facts_of
from pipeline.simulator.wall import shape as wall_shape
from pipeline.simulator.wall.description import Bend, Pipe
from pipeline.simulator.wall.grid import Seeds, Wall, above_share, field, grid_over
from pipeline.simulator.wall.shape import bore_radius, coarse_field

HERE = Path()
SMOOTH = {"roughness_mm": 0.0}
PLAIN = {"mottle": 0.0, "grain": 0.0, "albedo": 0.4}


def wall(seed: int = 1, folder: Path = HERE, **pipe: Any) -> Wall:
    return build_wall(described(**pipe), seed, folder)


def described(**pipe: Any) -> Pipe:
    usual = {"diameter_mm": 40.0, "from_mm": -20.0, "to_mm": 60.0, "relief": SMOOTH, "surface": PLAIN}
    return Pipe.model_validate_json(json.dumps(usual | pipe))


def column(made: Wall, azimuth_deg: float) -> int:
    return int(np.argmin(np.abs(made.shape.azimuth_rad - np.radians(azimuth_deg))))


def row(made: Wall, distance_mm: float) -> int:
    return int(np.argmin(np.abs(made.shape.distance_mm - distance_mm)))


def test_the_same_seed_gives_the_same_wall_and_another_seed_another() -> None:
    rough = {"relief": {"roughness_mm": 0.05}, "surface": {"rust": 0.3, "spots": 0.1, "streaks": 0.3}}
    first, again, other = (wall(seed, **rough) for seed in (1, 1, 2))
    assert first.radius_mm.tobytes() == again.radius_mm.tobytes()
    assert first.albedo_bgr.tobytes() == again.albedo_bgr.tobytes()
    assert np.abs(first.radius_mm - other.radius_mm).max() > 0.05
    assert np.abs(first.albedo_bgr - other.albedo_bgr).mean() > 0.02


def test_one_more_defect_does_not_change_the_rest_of_the_wall() -> None:
    one = {"kind": "pit", "distance_mm": 20.0, "azimuth_deg": 0.0, "length_mm": 6.0, "width_mm": 6.0}
    rough = {"relief": {"roughness_mm": 0.05}, "surface": {"rust": 0.3}}
    without, with_pit = wall(**rough), wall(**rough, defects=[one | {"depth_mm": 1.0}])
    changed = np.abs(with_pit.radius_mm - without.radius_mm) > 0
    s, psi = np.nonzero(changed)
    assert 0 < changed.mean() < 0.02
    assert np.abs(without.shape.distance_mm[s] - 20).max() < 5
    assert np.abs(without.shape.azimuth_rad[psi] * 20).max() < 5


@pytest.mark.parametrize("kind", ["pit", "dent", "gouge", "crack", "corrosion", "deposit"])
def test_defects_have_their_depth_and_size(kind: str) -> None:
    made = wall(
        cell_mm=0.1,
        defects=[
            {"kind": kind, "distance_mm": 20.0, "azimuth_deg": 30.0, "length_mm": 16.0,
             "width_mm": 1.0 if kind == "crack" else 10.0, "depth_mm": 1.5}
        ],
    )  # fmt: skip
    relief = made.radius_mm - 20.0
    sign = -1 if kind in ("dent", "deposit") else 1
    assert 0.75 * 1.5 < (sign * relief).max() <= 1.5 * 1.001
    s, psi = np.nonzero(np.abs(relief) > 0.15)
    assert 8 < np.ptp(made.shape.distance_mm[s]) < 20
    assert np.degrees(np.abs(made.shape.azimuth_rad[psi].mean()) - np.radians(30)) < 5


def test_an_oblique_gouge_has_the_given_direction() -> None:
    made = wall(
        defects=[
            {"kind": "gouge", "distance_mm": 20.0, "azimuth_deg": 0.0, "length_mm": 16.0, "width_mm": 2.0,
             "depth_mm": 0.5, "angle_deg": 30.0}
        ]
    )  # fmt: skip
    s, psi = np.nonzero(made.radius_mm > 20.1)
    slope = np.polyfit(made.shape.distance_mm[s] - 20, made.shape.azimuth_rad[psi] * 20, 1)[0]
    assert np.degrees(np.arctan(slope)) == pytest.approx(30, abs=3)


def test_steps_taper_oval_and_joint_have_their_size() -> None:
    bore = [{"length_mm": 20.0, "diameter_mm": 40.0}, {"length_mm": 20.0, "diameter_mm": 30.0}]
    pipe = described(bore=bore, chamfer_mm=0.8)
    s = np.array([-15.0, 0.0, 19.0, 19.8, 20.0, 20.2, 21.0, 55.0])
    assert bore_radius(s, pipe) == pytest.approx([20, 20, 20, 18.75, 17.5, 16.25, 15, 15])
    made = wall(taper=0.01, ovality={"amplitude_mm": 0.5, "direction_deg": 20.0})
    at = made.radius_mm[row(made, 40.0)]
    assert at[column(made, 20)] == pytest.approx(20.4 + 0.5, abs=1e-3)
    assert at[column(made, 110)] == pytest.approx(20.4 - 0.5, abs=1e-3)
    joint = {"distance_mm": 30.0, "gap_mm": 2.0, "depth_mm": 1.5, "offset_mm": 0.4, "direction_deg": 90.0}
    made = wall(joints=[joint])
    assert made.radius_mm[row(made, 30.0)].mean() == pytest.approx(21.5, abs=0.01)
    assert made.radius_mm[row(made, 40.0), column(made, 90)] == pytest.approx(20.4, abs=1e-3)
    assert made.radius_mm[row(made, 20.0)] == pytest.approx(20.0)


def test_a_weld_reduces_the_radius_and_a_branch_is_a_dark_hole() -> None:
    made = wall(
        welds=[{"distance_mm": 10.0, "width_mm": 6.0, "height_mm": 0.8}],
        branches=[{"distance_mm": 40.0, "azimuth_deg": -90.0, "diameter_mm": 12.0, "depth_mm": 9.0}],
    )
    bead = made.radius_mm[row(made, 10.0)] - 20
    assert np.all((bead < -0.3) & (bead > -1.4))
    assert bead.mean() == pytest.approx(-0.8, abs=0.1)
    hole = made.radius_mm > 24.5
    area = hole.sum() * made.shape.step_mm * 2 * np.pi * 20 / made.shape.columns
    assert area == pytest.approx(np.pi * 6**2, rel=0.15)
    texture_row = int(np.argmin(np.abs(made.texture.distance_mm - 40)))
    texture_column = int(np.argmin(np.abs(made.texture.azimuth_rad + np.pi / 2)))
    assert made.albedo_bgr[texture_row, texture_column].max() < 0.05


def test_roughness_has_the_stated_size_and_no_seam() -> None:
    made = wall(relief={"roughness_mm": 0.05, "roughness_longest_mm": 8.0})
    rough = made.radius_mm - 20.0
    assert rough.std() == pytest.approx(0.05, rel=0.02)
    seam = np.abs(rough[:, 0] - rough[:, -1]).mean()
    assert seam == pytest.approx(np.abs(np.diff(rough, axis=1)).mean(), rel=0.2)


def test_noise_is_band_limited_and_shares_are_right() -> None:
    grid = grid_over((0.0, 80.0), 20.0, 0.1)
    values = field(grid, np.random.default_rng(0), longest_mm=10.0, shortest_mm=2.0)
    power = np.abs(np.fft.rfft(values, axis=1)).mean(0) ** 2
    wave = 1 / np.maximum(np.fft.rfftfreq(grid.shape[1], grid.arc_step_mm), 1e-9)
    assert power[wave < 1.0].sum() < 1e-6 * power.sum()
    assert above_share(values, 0.3, 0.01).mean() == pytest.approx(0.3, abs=0.02)


def test_rust_is_where_the_relief_has_it() -> None:
    made = wall(
        relief={"roughness_mm": 0.0, "rust_mm": 0.2}, surface=PLAIN | {"rust": 0.4, "rust_patch_mm": 20.0}
    )
    red = cv2.resize(
        made.albedo_bgr[..., 2] / made.albedo_bgr[..., 0], made.radius_mm.shape[::-1],
        interpolation=cv2.INTER_AREA,
    )  # fmt: skip
    assert np.corrcoef(red.ravel(), (20 - made.radius_mm).ravel())[0, 1] > 0.9


def test_texture_is_as_fine_as_a_frame_shows() -> None:
    made = wall(diameter_mm=101.6, surface={"mottle": 0.0, "grain": 0.12})
    green = made.albedo_bgr[..., 1]
    # neighbours one frame's finest detail apart (shared notes: 0.085 x 0.133 mm at 4 inch) must differ
    apart = round(0.25 / made.texture.step_mm)
    assert np.std(green[apart:] - green[:-apart]) > 0.5 * np.std(green)
    assert made.texture.step_mm <= 0.133


def test_a_bent_axis_is_an_arc_that_starts_along_z() -> None:
    made = wall(
        bends=[{"distance_mm": 0.0, "length_mm": 60.0, "curvature_per_mm": 0.01, "direction_deg": 90.0}]
    )
    axis = made.axis
    end = int(np.argmin(np.abs(axis.distance_mm - 50)))
    assert axis.origin_p[end] == pytest.approx([0, 100 * (1 - np.cos(0.5)), 100 * np.sin(0.5)], abs=1e-6)
    assert axis.R_pa[end, :, 2] == pytest.approx([0, np.sin(0.5), np.cos(0.5)], abs=1e-9)
    assert axis.origin_p[int(np.argmin(np.abs(axis.distance_mm + 10)))] == pytest.approx([0, 0, -10])
    # the wall on the inside of the bend is nearer to the arc's centre
    inner = from_pipe(axis, np.array(50.0), np.array(np.pi / 2), np.array(20.0))
    assert np.linalg.norm(inner - [0, 100, 0]) == pytest.approx(80, abs=1e-4)


def test_two_bends_in_different_planes_keep_unit_frames() -> None:
    made = wall(
        bends=[
            Bend(distance_mm=5.0, length_mm=20.0, curvature_per_mm=0.01, direction_deg=0.0).model_dump(),
            Bend(distance_mm=25.0, length_mm=20.0, curvature_per_mm=0.01, direction_deg=90.0).model_dump(),
        ]
    )
    R = made.axis.R_pa
    assert R @ np.swapaxes(R, 1, 2) == pytest.approx(np.broadcast_to(np.eye(3), R.shape), abs=1e-9)
    step = np.linalg.norm(np.diff(made.axis.origin_p, axis=0), axis=1)
    assert step == pytest.approx(np.diff(made.axis.distance_mm), rel=1e-5)


FIDUCIALS = {"size_mm": 6.0, "rings": [{"distance_mm": 20.0, "count": 8, "azimuth_deg": -157.5}]}


def test_fiducials_can_be_decoded_on_the_unrolled_wall_at_their_stated_places() -> None:
    pipe = described(fiducials=FIDUCIALS)
    made = build_wall(pipe, 1, HERE)
    # columns of the picture run along +azimuth and rows along +distance, as the markers' own do
    picture = np.clip(made.albedo_bgr[..., 1] * 255, 0, 255).astype(np.uint8)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_100))
    corners, ids, _ = detector.detectMarkers(picture)
    found = {int(n): c[0] for n, c in zip(ids.ravel(), corners, strict=True)}
    stated = facts_of(pipe).fiducials
    assert stated is not None
    assert sorted(found) == [m.id for m in stated.markers]
    arc = 2 * np.pi * 20 / made.texture.columns
    for marker in stated.markers:
        middle = found[marker.id].mean(0)
        azimuth = (middle[0] + 0.5) * 2 * np.pi / made.texture.columns - np.pi
        assert np.degrees(azimuth) == pytest.approx(marker.azimuth_deg, abs=0.3)
        assert made.texture.distance_from_mm + middle[1] * made.texture.step_mm == pytest.approx(20, abs=0.1)
        edge = np.linalg.norm(np.diff(found[marker.id], axis=0), axis=1)
        assert edge[0] * arc == pytest.approx(6.0, abs=0.2)
        assert edge[1] * made.texture.step_mm == pytest.approx(6.0, abs=0.2)


def test_a_marker_on_a_smaller_bore_keeps_its_size() -> None:
    bore = [{"length_mm": 10.0, "diameter_mm": 40.0}, {"length_mm": 30.0, "diameter_mm": 30.0}]
    one = {"size_mm": 6.0, "quiet": 0.2, "rings": [{"distance_mm": 25.0, "count": 1, "azimuth_deg": 0.0}]}
    made = wall(bore=bore, fiducials=one, surface=PLAIN | {"albedo": 0.2})
    line = made.albedo_bgr[int(np.argmin(np.abs(made.texture.distance_mm - 22.5))), :, 1]
    black = made.texture.azimuth_rad[line < 0.1]
    assert np.ptp(black) * 15 == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize(
    ("fiducials", "said"),
    [
        ({"rings": [{"distance_mm": 20.0, "count": 30}]}, "overlap"),
        ({"rings": [{"distance_mm": 20.0, "count": 4}, {"distance_mm": 24.0, "count": 4}]}, "overlap"),
        ({"rings": [{"distance_mm": 10.5, "count": 4}]}, "over the step"),
        ({"dictionary": "DICT_9X9", "rings": [{"distance_mm": 20.0, "count": 4}]}, "DICT_9X9"),
        (
            {"dictionary": "DICT_4X4_50", "size_mm": 1.0, "rings": [{"distance_mm": 20.0, "count": 60}]},
            "only 50",
        ),
    ],
)
def test_fiducials_without_room_are_refused(fiducials: dict[str, Any], said: str) -> None:
    bore = [{"length_mm": 10.0, "diameter_mm": 40.0}, {"length_mm": 30.0, "diameter_mm": 38.0}]
    with pytest.raises(InputError, match=said):
        wall(bore=bore, fiducials={"size_mm": 6.0} | fiducials)


def test_a_photograph_is_applied_without_a_seam(tmp_path: Path) -> None:
    picture = np.zeros((40, 60, 3), np.uint8)
    picture[:, :30] = 200
    cv2.imwrite(str(tmp_path / "wall.png"), picture)
    made = wall(folder=tmp_path, photograph={"file": "wall.png", "mm_per_px": 0.5, "mean_albedo": 0.3})
    green = made.albedo_bgr[..., 1]
    assert green.mean() == pytest.approx(0.3, abs=0.02)
    assert np.abs(green[:, 0] - green[:, -1]).max() < 0.05
    edges = np.sum(np.abs(np.diff((green[10] > 0.3).astype(int))))
    assert edges == 2 * round(np.pi * 20 / 30)
    with pytest.raises(InputError, match=r"other\.png"):
        wall(folder=tmp_path, photograph={"file": "other.png", "mm_per_px": 0.5})


def test_the_resolution_of_the_relief_does_not_change_the_shape() -> None:
    fine, coarse = (wall(cell_mm=c, ovality={"amplitude_mm": 0.5}, taper=0.01) for c in (0.1, 0.5))
    grid = replace(coarse.shape)
    index = np.rint((grid.distance_mm - fine.shape.distance_from_mm) / fine.shape.step_mm).astype(int)
    inside = index < fine.shape.rows
    assert fine.radius_mm[index[inside]].mean(1) == pytest.approx(coarse.radius_mm[inside].mean(1), abs=1e-4)


def test_stains_of_a_pipe_longer_than_the_largest_picture_equal_those_of_its_parts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    grid, seeds = grid_over((-20.0, 180.0), 20.0, 0.1), Seeds(3)
    whole = coarse_field(grid, seeds.of("rust"), 30.0)
    monkeypatch.setattr(wall_shape, "_MOST_ROWS", 170)
    parts = coarse_field(grid, seeds.of("rust"), 30.0)
    # OpenCV interpolates at 32nds of a cell
    assert np.abs(parts - whole).max() < np.abs(np.diff(whole, axis=0)).max() / 10


def test_stains_may_have_more_rows_than_the_largest_picture() -> None:
    grid = grid_over((0.0, 40_000.0), 2.5, 1.0)
    stains = coarse_field(grid, Seeds(3).of("rust"), 200.0)
    assert stains.shape == grid.shape
    assert len(stains) > 32_767
    assert stains[-1000:].std() > 0.1
