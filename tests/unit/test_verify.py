"""Verification: what a run cannot know is removed, radius and shape stay, and the figures are right."""

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from pipeline.artefacts.measured import PointCloud, RadiusMap, Wall, WallTexture
from pipeline.artefacts.wall_map import WallMap
from pipeline.commands.verify import verify
from pipeline.errors import InputError, UnusableError
from pipeline.export.arrays import write_cloud
from pipeline.files.disk import files_sha256
from pipeline.geometry.axis import PipeAxis
from pipeline.geometry.rigid import from_parts, rotation_from_vector, transform
from pipeline.system.native import open3d
from stages.compare.reference import read_surface, read_wall_map, read_wall_points
from stages.compare.registration.by_points import register_points
from stages.compare.registration.by_radius import align_maps
from stages.compare.verify import (
    accuracy,
    bore_differences,
    map_differences,
    surface_differences,
    wall_coverage,
)
from tests.shared_data import shared

SIGMA = 0.03


def surface_radius(s, psi):
    """Return the radius of a wall with enough dents and pits to determine shift and roll."""
    r = 50.8 + 0.2 * np.cos(2 * psi - 0.7)
    for at, width, angle, depth in (
        (12, 4, 0.5, 1.0),
        (35, 3, 2.2, -0.8),
        (58, 5, -2.0, 0.7),
        (80, 3, -0.6, 1.1),
    ):
        turn = (psi - angle + np.pi) % (2 * np.pi) - np.pi
        r = r + depth * np.exp(-((s - at) ** 2) / (2 * width**2) - (50.8 * turn) ** 2 / (2 * width**2))
    return r


def wall(s, sigma=0.0, shift=0.0, roll=0.0, scale=0.0, pose=(0.0,) * 6, bias=0.0, seed=0):
    """Return a map of the same wall in another frame."""
    psi = -np.pi + 2 * np.pi * np.arange(180) / 180
    grid_s, grid_psi = np.meshgrid(s, psi, indexing="ij")
    middle = (s[0] + s[-1]) / 2
    x = (grid_s - middle) / max(np.ptp(s) / 2, 1.0)
    r = surface_radius(middle + (grid_s - middle) * (1 + scale) + shift, grid_psi + roll) + bias
    c, t = np.cos(grid_psi), np.sin(grid_psi)
    r = r + np.stack([c, t, x * c, x * t, x * x * c, x * x * t], -1) @ np.array(pose)
    r = r + np.random.default_rng(seed).normal(0, sigma, r.shape) if sigma else r
    return WallMap(s, psi, r, np.full_like(r, sigma), np.full_like(r, sigma))


TRUTH = wall(np.arange(-20.0, 120.0, 0.5))


def saved(path, m, *, sigma=True):
    arrays = {"distance_mm": m.distance_mm, "azimuth_rad": m.azimuth_rad, "radius_mm": m.radius_mm}
    np.savez(path, **arrays, **({"sigma_mm": m.sigma_mm} if sigma else {}))


def test_figures_for_a_known_bore_are_right():
    run = wall(np.arange(0, 50, 0.5))
    noise = np.random.default_rng(0).normal(0.02, SIGMA, run.radius_mm.shape)
    stated = np.full_like(noise, SIGMA)
    found = accuracy(
        bore_differences(WallMap(run.distance_mm, run.azimuth_rad, 50.8 + noise, stated, stated), 101.6, 0.0)
    )
    assert found.bias_mm == pytest.approx(0.02, abs=1e-3)
    assert found.rms_mm == pytest.approx(np.hypot(0.02, SIGMA), rel=0.02)
    assert found.mad_sigma_mm == pytest.approx(SIGMA, rel=0.03)
    # |N(2/3, 1)| < 1.96: Φ(1.293) − Φ(−2.627)
    assert found.within_95 == pytest.approx(0.8977, abs=0.006)


def test_what_a_run_cannot_know_is_removed_and_the_rest_stays():
    pose = (0.3, -0.2, 0.15, 0.1, -0.05, 0.08)
    run = wall(np.arange(0, 90, 0.5), SIGMA, 1.7, np.radians(2.3), 0.01, pose, bias=0.04)
    alignment = align_maps(run, TRUTH, 8.0, 5.0)
    assert alignment.shift_mm == pytest.approx(1.7, abs=0.03)
    assert alignment.roll_deg == pytest.approx(2.3, abs=0.03)
    # four features 68 mm apart, each placed to about 0.03 mm in this noise
    assert alignment.scale_error == pytest.approx(0.01, abs=2.5e-3)
    assert alignment.pose_mm == pytest.approx(pose, abs=4e-3)
    found = accuracy(map_differences(run, TRUTH, alignment))
    assert found.bias_mm == pytest.approx(0.04, abs=1e-3), "a wrong radius is not removed by the alignment"
    assert found.mad_sigma_mm == pytest.approx(SIGMA, rel=0.03)


def test_right_intervals_pass_and_too_small_ones_do_not():
    run = wall(np.arange(0, 90, 0.5), SIGMA)
    alignment = align_maps(run, TRUTH, 4.0, 2.0)
    assert accuracy(map_differences(run, TRUTH, alignment)).within_95 == pytest.approx(0.95, abs=0.006)
    boast = WallMap(run.distance_mm, run.azimuth_rad, run.radius_mm, run.sigma_mm / 2, run.sigma_random_mm)
    assert accuracy(map_differences(boast, TRUTH, alignment)).within_95 < 0.75


def test_a_local_error_of_the_run_is_found():
    run = wall(np.arange(0, 90, 0.5), SIGMA)
    run.radius_mm[60:66, 20:30] += 0.5
    differences = map_differences(run, TRUTH, align_maps(run, TRUTH, 4.0, 2.0))
    worst = differences.distance_mm[np.argmax(differences.error_mm)]
    assert differences.error_mm.max() > 0.45
    assert 30 <= worst <= 33


def test_holes_are_left_out_and_counted():
    run = wall(np.arange(0, 90, 0.5), SIGMA)
    run.radius_mm[50:60] = np.nan
    assert wall_coverage(run) == pytest.approx(1 - 10 / 180)
    differences = map_differences(run, TRUTH, align_maps(run, TRUTH, 4.0, 2.0))
    assert np.isfinite(differences.error_mm).all()
    assert len(differences.error_mm) == np.isfinite(run.radius_mm).sum()


def test_maps_that_do_not_overlap_are_refused():
    with pytest.raises(UnusableError, match="do not overlap"):
        align_maps(wall(np.arange(300.0, 390, 0.5)), TRUTH, 8.0, 5.0)


def test_wall_of_an_open_recording_against_itself_displaced():
    truth = read_wall_map(shared("recordings", "open-1-field"))
    inner = slice(40, -40)
    moved = WallMap(
        truth.distance_mm[inner] + 1.25, truth.azimuth_rad, truth.radius_mm[inner],
        truth.sigma_mm[inner], truth.sigma_random_mm[inner],
    )  # fmt: skip
    alignment = align_maps(moved, truth, 4.0, 2.0)
    assert alignment.shift_mm == pytest.approx(-1.25, abs=0.02)
    assert accuracy(map_differences(moved, truth, alignment)).rms_mm < 2e-3


def run_folder(folder, *, sigma=SIGMA, seed=0, offset=0.0):
    """Return a run folder with a map and a cloud of the wall, in another frame."""
    folder.mkdir(parents=True, exist_ok=True)
    s = np.arange(0, 90, 0.5)
    m = wall(s, sigma, seed=seed, bias=offset)
    saved(folder / "radius_map.npz", m)
    grid_s, grid_psi = np.meshgrid(s, m.azimuth_rad, indexing="ij")
    across = np.stack([np.cos(grid_psi), np.sin(grid_psi), 0 * grid_psi], -1)
    xyz = m.radius_mm[..., None] * across + grid_s[..., None] * np.array([0, 0, 1.0])
    flat = [np.ravel(a).astype(np.float32) for a in (m.sigma_mm, m.radius_mm, grid_s, grid_psi)]
    cloud = PointCloud(
        xyz.reshape(-1, 3).astype(np.float32), -across.reshape(-1, 3).astype(np.float32), *flat,
        np.zeros(s.size * 180, np.int64),
    )  # fmt: skip
    axis = PipeAxis(np.array([0.0, 90.0]), np.array([[0, 0, 0], [0, 0, 90.0]]), np.stack([np.eye(3)] * 2))
    empty = np.zeros((1, 1), np.float32)
    radius_map = RadiusMap(s, m.azimuth_rad, empty, empty, empty, np.zeros((1, 1), np.int64), empty)
    texture = WallTexture(np.zeros((2, 2, 4), np.uint8), 0.0, 1.0, 0.0, 1.0)
    write_cloud(Wall(cloud, radius_map, axis), texture, folder)
    return folder


def reference_mesh(path, *, triangles=True, pose=None):
    """Write the true wall as a mesh or cloud in another frame."""
    s, psi = np.arange(-5, 95, 0.5), -np.pi + 2 * np.pi * np.arange(360) / 360
    grid_s, grid_psi = np.meshgrid(s, psi, indexing="ij")
    r = surface_radius(grid_s, grid_psi)
    xyz = np.stack([r * np.cos(grid_psi), r * np.sin(grid_psi), grid_s], -1).reshape(-1, 3)
    xyz = transform(np.eye(4) if pose is None else pose, xyz)
    i, j = np.meshgrid(np.arange(len(s) - 1), np.arange(360), indexing="ij")
    a, b = i * 360 + j, i * 360 + (j + 1) % 360
    faces = np.concatenate([np.stack([a, b, a + 360], -1), np.stack([b, b + 360, a + 360], -1)]).reshape(
        -1, 3
    )
    o3d = open3d()
    if triangles:
        mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(xyz), o3d.utility.Vector3iVector(faces))
        o3d.io.write_triangle_mesh(str(path), mesh)
    else:
        o3d.io.write_point_cloud(str(path), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz)))
    return path


@pytest.mark.parametrize("triangles", [True, False])
def test_a_reference_surface_may_be_in_another_frame(tmp_path, triangles):
    run = run_folder(tmp_path / "run", offset=0.05)
    pose = from_parts(rotation_from_vector(np.array([0.7, -0.4, 1.1])), np.array([120.0, -40.0, 300.0]))
    file = reference_mesh(tmp_path / "wall.ply", triangles=triangles, pose=pose)
    points, surface = read_wall_points(run, 20_000), read_surface(file)
    found = register_points(points, surface)
    np.testing.assert_allclose(found.T_rp, pose, atol=0.03)
    figures = accuracy(surface_differences(points, surface, found, 5.0))
    assert figures.bias_mm == pytest.approx(0.05, abs=3e-3), "too large a radius is positive"
    assert figures.mad_sigma_mm == pytest.approx(SIGMA, rel=0.05)


def command(*arguments):
    app = typer.Typer()
    app.command()(verify)
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_repeatability_is_the_scatter_of_one_run(tmp_path):
    first, second = run_folder(tmp_path / "a", seed=1), run_folder(tmp_path / "b", seed=2)
    result = command(first, "--reference", second, "--max-shift-mm", 2, "--max-roll-deg", 1, "--json")
    document = json.loads(result.stdout)
    assert document["kind"] == "repeatability"
    assert document["repeatability_sd_mm"] == pytest.approx(SIGMA, rel=0.03)
    # noise must not pull the alignment into the middle between cells
    assert document["alignment"]["shift_mm"] == pytest.approx(0.0, abs=0.08)
    assert document["alignment"]["roll_deg"] == pytest.approx(0.0, abs=0.08)
    assert document["accuracy"]["within_95"] == pytest.approx(0.95, abs=0.006)
    assert not (first / "verify").exists(), "--json alone writes no files"


def test_the_certificate_is_one_page_and_data_that_agree(tmp_path):
    run = run_folder(tmp_path / "run")
    result = command(run, "--bore-diameter-mm", 101.6, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    page = (tmp_path / "out" / "certificate.html").read_text("utf-8")
    document = json.loads((tmp_path / "out" / "certificate.json").read_text("utf-8"))
    assert document["made_by"]["command"] == "verify"
    assert document["made_by"]["input_sha256"]["wall"] == files_sha256([run / "radius_map.npz"])
    log = (tmp_path / "out" / ".boresight" / "run.log").read_text("utf-8")
    assert "stage verify completed" in log
    assert 'src="http' not in page
    assert f"{document['accuracy']['rms_mm']:.3f} mm RMS against bore of 101.6 mm" in page


def test_the_relative_uncertainty_of_a_diameter_gives_half_of_it_in_radius():
    shape, none = (3, 4), np.zeros((3, 4))
    wall = WallMap(np.arange(3.0), np.arange(4.0), np.full(shape, 50.8), none, none)
    radius = 50.8 + np.random.default_rng(0).uniform(-0.2, 0.2, 100_000) / 2
    assert bore_differences(wall, 101.6, 0.2).sigma_mm == pytest.approx(radius.std(), rel=0.01)


def test_another_bore_gives_another_certificate_and_the_same_one_is_reused(tmp_path):
    run, out = run_folder(tmp_path / "run"), tmp_path / "out"
    for diameter, tolerance in ((101.6, 0.0), (101.6, 0.0), (102.6, 0.0)):
        result = command(run, "--bore-diameter-mm", diameter, "--bore-tolerance-mm", tolerance, "-o", out)
        assert result.exit_code == 0, result.output
        document = json.loads((out / "certificate.json").read_text("utf-8"))
        known = accuracy(bore_differences(read_wall_map(run), diameter, tolerance))
        assert document["accuracy"]["bias_mm"] == known.bias_mm
    log = (out / ".boresight" / "run.log").read_text("utf-8")
    assert log.count("stage verify starts") == 2, "the second call computes nothing"


def test_a_surface_in_metres_gives_the_same_figures_as_one_in_millimetres(tmp_path):
    run, file = run_folder(tmp_path / "run", offset=0.05), reference_mesh(tmp_path / "wall.ply")
    in_mm = json.loads(command(run, "--reference", file, "--json").stdout)
    assert in_mm["accuracy"]["bias_mm"] == pytest.approx(0.05, abs=3e-3)
    small = reference_mesh(tmp_path / "metres.ply", pose=np.diag([1e-3, 1e-3, 1e-3, 1.0]))
    in_m = json.loads(command(run, "--reference", small, "--set", "verify.reference_unit=m", "--json").stdout)
    assert in_m["accuracy"]["rms_mm"] == pytest.approx(in_mm["accuracy"]["rms_mm"], rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "either --reference or --bore-diameter-mm"),
        (["--bore-diameter-mm", "-1"], "bore-diameter-mm"),
        (["--reference", "nowhere"], "nowhere"),
        (["--reference", "nowhere.ply"], "nowhere.ply"),
        (["--reference", "wall.ply", "--reference-unit", "inch"], "inch"),
    ],
)
def test_bad_input_is_named_in_the_error(tmp_path, arguments, named):
    run = run_folder(tmp_path / "run")
    result = command(run, "--json", *arguments)
    assert result.exit_code != 0
    assert named in str(result.exception)


def test_a_run_is_refused_as_its_own_reference(tmp_path):
    run = run_folder(tmp_path / "run")
    assert "same map" in str(command(run, "--json", "--reference", run).exception)


def test_broken_maps_are_refused(tmp_path):
    (tmp_path / "radius_map.npz").write_bytes(b"PK no archive")
    with pytest.raises(InputError, match="cannot be read"):
        read_wall_map(tmp_path)
    np.savez(tmp_path / "radius_map.npz", distance_mm=np.arange(5.0), azimuth_rad=np.arange(4.0))
    with pytest.raises(InputError, match="0 radius maps"):
        read_wall_map(tmp_path)
    bent = WallMap(
        np.array([0.0, 1, 2, 4, 5]), np.arange(4.0), np.ones((5, 4)), np.ones((5, 4)), np.ones((5, 4))
    )
    saved(tmp_path / "radius_map.npz", bent)
    with pytest.raises(InputError, match="not uniform"):
        read_wall_map(tmp_path)
