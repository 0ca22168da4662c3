"""The wall as a mesh: geometry, holes, decimation, charts and baked textures."""

import dataclasses

import numpy as np
import pytest

from pipeline.artefacts.measured import Wall
from pipeline.artefacts.model import MeshTile, Overlays, TexturedMesh
from pipeline.errors import UnusableError
from pipeline.files.codec import digest
from pipeline.geometry.axis import PipeAxis, from_pipe, straight_axis, to_pipe
from pipeline.system.native import open3d
from stages.mesh import MeshParameters, make_mesh
from stages.mesh.fitted import cells_of, fitted_surface
from stages.mesh.surface import Surface, decimate, vertex_normals, weld, with_normals
from stages.overlays import OverlayParameters, overlays_of
from tests.quiet import quiet_context
from tests.unit.small_wall import PIT, RADIUS, bent_axis, drawn_radius, small_wall, smooth_photo, tee

HOLE = (slice(60, 72), slice(100, 130))


def error_colours(wall: Wall) -> Overlays:
    return overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters())


def meshed(wall: Wall, **parameters: object) -> TexturedMesh:
    chosen = MeshParameters.model_validate(parameters)
    return make_mesh(wall, smooth_photo(), error_colours(wall), chosen, quiet_context())


@pytest.fixture(scope="module")
def plain() -> TexturedMesh:
    """Two tiles, decimated with a strict bound."""
    return meshed(small_wall(), tile_mm=25.0, noise_factor=0.0, error_mm=0.01)


def grid(wall: Wall, pieces: int = 1) -> list[Surface]:
    """The surface with a vertex at every cell, as no cell may be smoothed. Walls without noise need fewer."""
    return [p.surface for p in fitted_surface(cells_of(wall, 1e-6, 0.0), wall.axis, pieces, 0.0)]


def boundary_edges(face: np.ndarray) -> np.ndarray:
    """Return edges (N, 2) that belong to one triangle only; fail where one belongs to more than two."""
    edge = np.sort(face[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found, count = np.unique(edge, axis=0, return_counts=True)
    assert count.max() <= 2
    return found[count == 1]


def joined(mesh: TexturedMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of all tiles, with equal positions merged."""
    vertex = np.concatenate([t.vertex_p for t in mesh.tiles])
    starts = np.cumsum([0, *(len(t.vertex_p) for t in mesh.tiles)])
    face = np.concatenate([t.face + s for t, s in zip(mesh.tiles, starts, strict=False)])
    unique, same = np.unique(vertex, axis=0, return_inverse=True)
    return unique, same.ravel()[face]


def radius_seen(mesh: TexturedMesh, wall: Wall, s: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Return the radius of the mesh by rays from the axis; NaN where they leave through a hole.

    The rays pass 0.1 µm beside their aim, since one that meets an edge exactly may slip through.
    """
    s, psi = s + 1e-4, psi + 4e-6
    scene = open3d().t.geometry.RaycastingScene()
    for tile in mesh.tiles:
        scene.add_triangles(tile.vertex_p, tile.face.astype(np.uint32))
    start = from_pipe(wall.axis, s, psi, np.zeros_like(s))
    away = from_pipe(wall.axis, s, psi, np.ones_like(s)) - start
    hit = scene.cast_rays(np.concatenate([start, away], -1).astype(np.float32))["t_hit"].numpy()
    return np.where(np.isfinite(hit), hit, np.nan)


@pytest.mark.parametrize("axis", [straight_axis(-40.0, 120.0), bent_axis(2e-3)])
def test_the_full_grid_reproduces_the_radius_map(axis: PipeAxis) -> None:
    wall = small_wall(axis=axis, noise_mm=0.02)
    radius = wall.radius_map.radius_mm
    (surface,) = grid(wall)
    s, psi, r = to_pipe(axis, surface.vertex_p)
    np.testing.assert_allclose(r.reshape(radius.shape), radius, atol=1e-3)
    np.testing.assert_allclose(
        s.reshape(radius.shape),
        np.broadcast_to(wall.radius_map.distance_mm[:, None], radius.shape),
        atol=1e-3,
    )
    far = np.abs((psi.reshape(radius.shape) - wall.radius_map.azimuth_rad + np.pi) % (2 * np.pi) - np.pi)
    assert far.max() * RADIUS < 1e-3


@pytest.mark.parametrize("columns", [360, 225])
def test_the_grid_is_closed_around_the_pipe_and_faces_inward(columns: int) -> None:
    wall = small_wall(noise_mm=0.02, columns=columns)
    rows = len(wall.radius_map.radius_mm)
    (surface,) = grid(wall)
    assert len(surface.face) == 2 * (rows - 1) * columns
    open_edges = boundary_edges(surface.face)
    assert len(open_edges) == 2 * columns
    assert set(np.unique(surface.vertex_p[open_edges][..., 2])) == {0.0, 50.0}
    a, b, c = np.moveaxis(surface.vertex_p[surface.face], 1, 0)
    assert np.all(np.sum(np.cross(b - a, c - a)[:, :2] * a[:, :2], axis=1) < 0)


@pytest.mark.parametrize("at", [(10, 20), (11, 20), (11, 21), (8, 16), (13, 0), (10, 359)])
def test_holes_remain_and_single_missing_cells_leave_triangles_out(at: tuple[int, int]) -> None:
    wall = small_wall(noise_mm=0.02, hole=(slice(at[0], at[0] + 1), slice(at[1], at[1] + 1)))
    rows, columns = wall.radius_map.radius_mm.shape
    (surface,) = grid(wall)
    assert len(surface.face) == 2 * (rows - 1) * columns - 4
    assert len(boundary_edges(surface.face)) == 2 * columns + 4


@pytest.mark.parametrize("pieces", [3, 40])
def test_pieces_share_their_border_rows(pieces: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stages.mesh.bisection._SQUARES_AT_ONCE", 10_000)
    wall = small_wall(noise_mm=0.02)
    coarse = [p.surface for p in fitted_surface(cells_of(wall, 0.02, 4.0), wall.axis, pieces, 3.0)]
    assert len(coarse) == min(pieces, 13)  # of 8 rows
    assert len(boundary_edges(weld(coarse).face)) == len(
        boundary_edges(next(fitted_surface(cells_of(wall, 0.02, 4.0), wall.axis, 1, 3.0)).surface.face)
    )
    surface = weld(grid(wall, pieces))
    assert len(boundary_edges(surface.face)) == 2 * 360
    assert len(surface.vertex_p) == wall.radius_map.radius_mm.size


def test_noise_is_averaged_but_pits_are_not() -> None:
    """The mesh is nearer to the drawn wall, which was not an input, than the cells it is made of."""
    wall = small_wall(noise_mm=0.02)
    at, around, _, width = PIT
    radius_map = wall.radius_map
    s, psi = np.meshgrid(radius_map.distance_mm[1:-1], radius_map.azimuth_rad, indexing="ij")
    true, cells = drawn_radius(s, psi), radius_map.radius_mm[1:-1]
    found = radius_seen(meshed(wall), wall, s, psi)
    turn = (psi - around + np.pi) % (2 * np.pi) - np.pi
    near = np.hypot(s - at, RADIUS * turn) < 2 * width
    assert np.std(found - true) < 0.6 * np.std(cells - true)
    assert np.std((found - true)[near]) < np.std((cells - true)[near])
    assert abs((found - true)[near].mean()) < 0.004
    # Controls: with free cuts the mesh follows the noise; with cuts too dear to be made it loses the pit.
    noisy = radius_seen(meshed(wall, triangle_cost=0.0), wall, s, psi)
    assert np.std(noisy - true) > 0.9 * np.std(cells - true)
    lost = radius_seen(meshed(wall, triangle_cost=1e6, error_mm=5.0), wall, s, psi)
    assert np.std((lost - true)[near]) > 5 * np.std((cells - true)[near])


def test_decimated_tiles_close_around_the_seam_and_to_each_other(plain: TexturedMesh) -> None:
    assert len(plain.tiles) == 2
    vertex, face = joined(plain)
    ends = vertex[boundary_edges(face)][..., 2]
    assert np.all((ends < 0.01) | (ends > 49.99))


def test_decimation_stays_within_its_bound(plain: TexturedMesh) -> None:
    assert plain.triangles < 0.5 * plain.wall_triangles
    assert 0 < plain.decimation_error_mm <= 0.01
    wall = small_wall()
    s, psi = np.meshgrid(wall.radius_map.distance_mm[1:-1], wall.radius_map.azimuth_rad, indexing="ij")
    error = radius_seen(plain, wall, s, psi) - wall.radius_map.radius_mm[1:-1]
    # Along the radius, not to the nearest point: the pit's flanks slope by up to 20 degrees.
    assert np.abs(error).max() < 0.01 / np.cos(np.radians(25))
    assert np.abs(error).max() > 0.2 * plain.decimation_error_mm


def test_no_vertex_leaves_the_wall(plain: TexturedMesh) -> None:
    """On a wall without curvature along the pipe, a collapse can throw a vertex anywhere along it."""
    vertex = np.concatenate([t.vertex_p for t in plain.tiles])
    assert vertex[:, 2].min() > -0.01
    assert vertex[:, 2].max() < 50.01
    radius = np.hypot(vertex[:, 0], vertex[:, 1])
    far = np.abs(radius - drawn_radius(vertex[:, 2], np.arctan2(vertex[:, 1], vertex[:, 0])))
    assert far.max() < 0.03
    for tile in plain.tiles:
        assert np.ptp(tile.vertex_p[tile.face][..., 2], axis=1).max() < 12


def test_where_the_bound_cannot_be_kept_the_grid_stays() -> None:
    (surface,) = grid(small_wall(noise_mm=0.05, length_mm=10.0))
    kept = decimate(surface, 500, 1e-5)
    assert len(kept.surface.face) == len(surface.face)
    assert kept.largest_error_mm < 1e-5


def test_pit_depth_survives_noise_and_decimation() -> None:
    wall = small_wall(noise_mm=0.02)
    mesh = meshed(wall)
    assert mesh.triangles < 0.5 * mesh.wall_triangles
    at, around, depth, _ = PIT
    s, psi = np.meshgrid(at + np.linspace(-0.5, 0.5, 9), around + np.linspace(-0.5, 0.5, 9) / RADIUS)
    seen = radius_seen(mesh, wall, s, psi).mean()
    # Nine grid cells of noise 0.02 leave 0.007 mm of the map's noise.
    true = drawn_radius(s, psi).mean()
    assert depth > 1
    assert abs(seen - true) < 0.015


def test_unmeasured_wall_stays_a_hole() -> None:
    wall = small_wall(hole=HOLE)
    mesh = meshed(wall)
    psi = wall.radius_map.azimuth_rad
    s_in, psi_in = np.meshgrid(np.arange(30.5, 35.3, 0.5), psi[102:128])
    assert np.isnan(radius_seen(mesh, wall, s_in, psi_in)).all()
    s_out, psi_out = np.meshgrid(np.arange(27.0, 29.0, 0.5), psi)
    assert np.isfinite(radius_seen(mesh, wall, s_out, psi_out)).all()


@pytest.mark.parametrize("surface", ["grid", "poisson"])
def test_charts_lie_in_the_atlas_and_never_overlap(surface: str) -> None:
    cloud, axis = tee()
    wall = small_wall(axis=axis) if surface == "grid" else Wall(cloud, small_wall().radius_map, axis)
    for tile in meshed(wall, surface=surface).tiles:
        assert tile.uv.min() >= 0
        assert tile.uv.max() <= 1
        assert overlap(tile) < 1e-4


def overlap(tile: MeshTile) -> float:
    """Return the share of points of the atlas that lie in more than one triangle."""
    flat = np.column_stack([tile.uv, np.zeros(len(tile.uv))]).astype(np.float32)
    scene = open3d().t.geometry.RaycastingScene()
    scene.add_triangles(flat, tile.face.astype(np.uint32))
    point = np.random.default_rng(0).uniform(size=(200_000, 2))
    up = np.tile([-1.0, 0.0, 0.0, 1.0], (len(point), 1))
    count = scene.count_intersections(np.column_stack([point, up]).astype(np.float32)).numpy()
    assert np.mean(count == 1) > 0.4
    return float(np.mean(count > 1))


def test_photo_and_error_colours_are_at_their_places(plain: TexturedMesh) -> None:
    wall, photo = small_wall(), smooth_photo()
    overlays = error_colours(wall)
    for tile in plain.tiles:
        s, psi, _ = to_pipe(wall.axis, tile.vertex_p.astype(float))
        px = tile.uv * np.array(tile.photo_bgr.shape[1::-1]) - 0.5
        column, row = np.clip(np.rint(px).astype(int), 0, np.array(tile.photo_bgr.shape[1::-1]) - 1).T
        grey = tile.photo_bgr[row, column].astype(float)
        want = np.stack(
            [60 + 2 * (s - photo.distance_from_mm), 128 + 90 * np.cos(psi), 128 + 90 * np.sin(psi)], -1
        )
        assert np.abs(grey - want).max() < 3
        error = next(e for e in tile.errors if e.variant == "misalignment")
        h, w = error.level.shape
        level = error.level[
            np.minimum((tile.uv[:, 1] * h).astype(int), h - 1),
            np.minimum((tile.uv[:, 0] * w).astype(int), w - 1),
        ]
        value = overlays.misalignment.low_mm + (level - 1.0) / 254 * (2 * overlays.misalignment.high_mm)
        assert np.abs(value - 0.2 * np.cos(psi)).max() < 0.01


def test_atlases_stay_within_their_size_limit() -> None:
    mesh = meshed(small_wall(length_mm=40.0), texel_mm=0.05, atlas_px=1024)
    assert len(mesh.tiles) > 1
    assert max(max(t.photo_bgr.shape[:2]) for t in mesh.tiles) <= 1024


def test_the_same_wall_gives_the_same_bytes() -> None:
    wall = small_wall(noise_mm=0.01, length_mm=20.0)
    assert digest(meshed(wall, tile_mm=10.0)) == digest(meshed(wall, tile_mm=10.0))


def test_a_wall_without_measurements_is_refused() -> None:
    wall = small_wall(length_mm=10.0)
    colours = error_colours(wall)
    none = dataclasses.replace(wall.radius_map, radius_mm=np.full_like(wall.radius_map.radius_mm, np.nan))
    wall = dataclasses.replace(wall, radius_map=none)
    with pytest.raises(UnusableError, match="no cell of the wall"):
        make_mesh(wall, smooth_photo(), colours, MeshParameters(), quiet_context())


def test_normals_are_those_of_open3d() -> None:
    o3d = open3d()
    piece = grid(small_wall(noise_mm=0.05, hole=HOLE), 1)[0]
    corner = piece.vertex_p[piece.face[0]]
    flat = dataclasses.replace(
        piece,
        vertex_p=np.concatenate([piece.vertex_p, corner[[0, 0, 0]]]),
        face=np.concatenate([piece.face, len(piece.vertex_p) + np.arange(3, dtype=np.int32)[None]]),
    )
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(flat.vertex_p), o3d.utility.Vector3iVector(flat.face)
    )
    wanted = np.asarray(mesh.compute_vertex_normals().vertex_normals)
    np.testing.assert_allclose(vertex_normals(flat), wanted, atol=1e-12)


def test_normals_are_continuous_from_piece_to_piece() -> None:
    pieces = grid(small_wall(noise_mm=0.05, hole=HOLE), 3)
    whole = weld(pieces)
    wanted = {tuple(v): n for v, n in zip(whole.vertex_p, vertex_normals(whole), strict=True)}
    found = list(with_normals(iter(pieces)))
    assert sum(len(surface.face) for surface, _ in found) == len(whole.face)
    for surface, normal in found:
        np.testing.assert_allclose(normal, [wanted[tuple(v)] for v in surface.vertex_p], atol=1e-9)
    alone = vertex_normals(found[0][0])
    assert np.abs(alone - found[0][1]).max() > 1e-3, (
        "control: the normals of a single piece differ at the joint"
    )
