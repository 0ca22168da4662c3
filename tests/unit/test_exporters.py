"""The exported files of a run folder contain the data of the artefacts, under the agreed names."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zarr
from scipy.spatial.transform import Rotation

from pipeline.artefacts.measured import PointCloud, RadiusMap, RingSamples, Trajectory, Wall
from pipeline.artefacts.motion import PipePiece
from pipeline.errors import InputError
from pipeline.export.arrays import write_radius_map, write_rings
from pipeline.export.tables import write_centreline, write_trajectory
from pipeline.geometry.axis import PipeAxis
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.compare.reference import read_wall_map
from tests.pose_chain import chain, curved


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(1)


def axis() -> PipeAxis:
    return PipeAxis(np.arange(2.0), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)))


def rings_of(random: np.random.Generator, frames: int) -> RingSamples:
    shape = (frames, 90)
    validity = random.integers(0, 3, shape).astype(np.uint8)
    radius = np.where(validity == 0, random.normal(400, 1, shape), np.nan).astype(np.float32)
    sigma, width, amplitude = (random.random(shape, dtype=np.float32) for _ in range(3))
    azimuth = -np.pi + np.arange(90) * 2 * np.pi / 90
    frame = np.arange(frames, dtype=np.int64) * 2
    return RingSamples(frame, azimuth, np.array([1.5, 2.5]), radius, sigma, width, amplitude, validity)


@pytest.mark.parametrize("frames", [0, 1, 150])
def test_rings(tmp_path: Path, random: np.random.Generator, frames: int) -> None:
    rings = rings_of(random, frames)
    write_rings(rings, tmp_path)
    group = zarr.open_group(tmp_path / "rings.zarr", mode="r")
    expected = {
        "radius_px": rings.radius_px,
        "sigma_px": rings.sigma_px,
        "line_width_px": rings.width_px,
        "amplitude": rings.amplitude,
        "valid": rings.valid,
        "frame": rings.frame,
        "azimuth_rad": rings.azimuth_rad,
    }
    for name, values in expected.items():
        read = np.asarray(group[name])
        assert read.dtype == values.dtype
        np.testing.assert_array_equal(read, values, err_msg=name)
    assert group.attrs["centre_px"] == [1.5, 2.5]
    assert group.attrs["validity_codes"]["valid"] == 0


def test_rings_are_written_with_the_same_bytes_again(tmp_path: Path, random: np.random.Generator) -> None:
    rings = rings_of(random, 70)
    files = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_rings(rings, tmp_path / name)
        files.append(
            {
                p.relative_to(tmp_path / name): p.read_bytes()
                for p in (tmp_path / name).rglob("*")
                if p.is_file()
            }
        )
    assert files[0] == files[1]


@pytest.mark.parametrize("start_s", [0.0, 1764210000.123456])
def test_trajectory(tmp_path: Path, random: np.random.Generator, start_s: float) -> None:
    """With times since 1970, as in bags, all rows of a recording were given the same time."""
    count = 20
    rotation = rotation_from_vector(random.normal(0, 0.5, (count, 3)))
    T_pc = from_parts(rotation, random.normal(0, 100, (count, 3)))
    half = random.normal(size=(count, 6, 6))
    covariance = half @ np.swapaxes(half, 1, 2)
    time = start_s + np.arange(count) / 30
    trajectory = Trajectory(np.arange(count) + 5, time, T_pc, covariance, axis(), 50.0, 1.0, 0.001, 0.001, ())
    write_trajectory(trajectory, tmp_path)
    with (tmp_path / "trajectory.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    table = {name: np.array([float(r[name]) for r in rows]) for name in rows[0]}
    assert list(table)[:9] == ["frame", "time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    np.testing.assert_array_equal(table["frame"], trajectory.frame)
    np.testing.assert_allclose(table["time_s"], time, rtol=0, atol=1e-6)
    for k, name in enumerate(("x_mm", "y_mm", "z_mm")):
        np.testing.assert_allclose(table[name], T_pc[:, k, 3], rtol=1e-8)
    quaternion = np.stack([table[n] for n in ("qw", "qx", "qy", "qz")], -1)
    np.testing.assert_allclose(
        Rotation.from_quat(quaternion, scalar_first=True).as_matrix(), rotation, atol=1e-8
    )
    names = [f"sigma_{n}" for n in ("x_mm", "y_mm", "z_mm", "rx_rad", "ry_rad", "rz_rad")]
    for k, name in enumerate(names):
        np.testing.assert_allclose(table[name] ** 2, covariance[:, k, k], rtol=1e-7)


def test_radius_map(tmp_path: Path, random: np.random.Generator) -> None:
    shape = (7, 12)
    radius, sigma, part, misalignment = (random.random(shape, dtype=np.float32) for _ in range(4))
    radius[2, 3] = np.nan
    count = random.integers(0, 9, shape)
    azimuth = -np.pi + np.arange(12) * np.pi / 6
    displaced = np.linspace(0, 0.1, 7)
    parts = radius, sigma, part, count, misalignment
    radius_map = RadiusMap(np.arange(7.0), azimuth, *parts, displaced_mm=displaced)
    one = np.zeros(1, np.float32)
    cloud = PointCloud(
        np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32), one, one, one, one, np.zeros(1, np.int64)
    )
    write_radius_map(Wall(cloud, radius_map, axis()), tmp_path)
    with np.load(tmp_path / "radius_map.npz") as read:
        for name in ("distance_mm", "azimuth_rad", "radius_mm", "sigma_mm", "count", "misalignment_mm"):
            np.testing.assert_array_equal(read[name], getattr(radius_map, name), err_msg=name)
        np.testing.assert_array_equal(read["sigma_random_mm"], part)
    np.testing.assert_array_equal(read_wall_map(tmp_path).displaced_mm, displaced)
    with np.load(tmp_path / "radius_map.npz") as read:
        arrays = dict(read)
    np.savez(tmp_path / "radius_map.npz", **(arrays | {"displaced_mm": displaced[1:]}))
    with pytest.raises(InputError, match="displaced_mm"):
        read_wall_map(tmp_path)


def test_centreline(tmp_path: Path) -> None:
    axis = curved((1000.0, 0.0, 0.0), (300.0, 1.0, 0.5), (700.0, 0.0, 0.0))
    bend = PipePiece("bend", 1000.0, 1300.0, 1.0, 1.0, 0.01, 0.5, 300.0, 5.0, "3 D")
    pieces = (
        PipePiece("straight", 0.0, 1000.0, 1.0), bend, PipePiece("straight", 1300.0, 2000.0, 2.0)
    )  # fmt: skip
    run = replace(chain(axis).seen, pieces=pieces)
    write_centreline(run, tmp_path)
    table = np.genfromtxt(
        tmp_path / "centreline.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    np.testing.assert_allclose(
        np.stack([table[k] for k in ("x_mm", "y_mm", "z_mm")], -1)[-1], axis.origin_p[-1], atol=2
    )
    assert np.all(np.diff(table["distance_mm"]) > 0)
    assert set(table["piece"][table["distance_mm"] < 990]) == {"straight"}
    assert set(table["piece"][(table["distance_mm"] > 1010) & (table["distance_mm"] < 1290)]) == {"bend"}
    assert table["sigma_z_mm"][-1] == pytest.approx(np.sqrt(run.covariance[-1, 2, 2]), rel=1e-3)
    features = json.loads((tmp_path / "centreline.geojson").read_text())["features"]
    lines = [f["geometry"]["coordinates"] for f in features]
    assert [f["properties"]["kind"] for f in features] == ["straight", "bend", "straight"]
    assert lines[0][-1] == lines[1][0]
    np.testing.assert_allclose(lines[0][-1], [0, 0, 1.0], atol=1e-3)
    drawing = (tmp_path / "centreline.dxf").read_text().split("\n")
    assert len(drawing) % 2 == 1, "a code and a value in turn, and the end of the last line"
    codes, values = drawing[:-1:2], drawing[1::2]
    assert values.count("POLYLINE") == values.count("SEQEND") == 3
    drawn = [float(v) for c, v in zip(codes, values, strict=True) if c == "30"]
    assert max(drawn) == pytest.approx(axis.origin_p[:, 2].max(), abs=2)
    route = list(csv.DictReader((tmp_path / "route.csv").read_text().splitlines()))
    assert [r["standard"] for r in route] == ["", "3 D", ""]
    assert float(route[1]["angle_deg"]) == pytest.approx(57.3, abs=0.01)
    assert float(route[1]["toward_clock"]) == pytest.approx((np.degrees(0.5) + 90) / 30, abs=1e-4)


def test_a_way_too_short_for_a_decision_is_no_straight_length(tmp_path: Path) -> None:
    """80 mm of a bend that turned by 17.5° were written as a straight length that turns by 0°."""
    write_centreline(replace(chain(curved((80.0, 0.004, 0.0))).seen, pieces=()), tmp_path)
    (piece,) = csv.DictReader((tmp_path / "route.csv").read_text().splitlines())
    assert (piece["kind"], piece["angle_deg"], piece["angle_sigma_deg"]) == ("undecided", "", "")
    assert float(piece["length_mm"]) > 70


def test_a_rounding_error_of_a_zero_is_written_as_zero(tmp_path: Path) -> None:
    """A route started at −1.3e-18 mm."""
    piece = PipePiece("straight", -1.3e-18, 80.0, 0.1, 0.0, 0.01)
    write_centreline(replace(chain(curved((80.0, 0.004, 0.0))).seen, pieces=(piece,)), tmp_path)
    (row,) = csv.DictReader((tmp_path / "route.csv").read_text().splitlines())
    assert row["from_mm"] == "0"
    assert "e-" not in (tmp_path / "route.csv").read_text()
