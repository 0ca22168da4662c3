"""A Poisson surface made in pieces.

It has no gaps at the joints, and equals that of one piece, also at a branch.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.measured import Wall
from pipeline.system.native import open3d
from stages.mesh import MeshParameters, make_mesh
from stages.mesh.join import OpenMesh, clip, join
from stages.mesh.poisson import joined_pieces, piece_cuts, poisson_surface, seen_part
from stages.mesh.surface import Surface, weld
from stages.overlays import OverlayParameters, overlays_of
from tests.quiet import quiet_context
from tests.unit.small_wall import RADIUS, small_wall, smooth_photo, tee

LENGTH, CELL, REACH = 120.0, 1.6, 3.0
UP = np.array([0.0, 0.0, 1.0])


@cache
def drawn():
    cloud, axis = tee(24000, LENGTH, 0.05)
    return cloud_along(cloud), axis


@cache
def pieces(*cuts):
    along, axis = drawn()
    made = joined_pieces(
        along, axis, np.array(cuts), lambda c: poisson_surface(c.xyz_p, c.normal_p, CELL, REACH)
    )
    found = [(seen_part(mesh, REACH), unjoined) for mesh, unjoined in made]
    return [surface for surface, _ in found], sum(unjoined for _, unjoined in found)


def border_edges(surface):
    """Return the edges (E, 2) of only one triangle; no edge has more than two."""
    edges = np.sort(surface.face[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 2
    return edges[count == 1]


def open_at(surface, z):
    """Count border edges within 2 mm of a cut, without the open end of the branch."""
    middle = surface.vertex_p[border_edges(surface)].mean(1)
    return int(((np.abs(middle[:, 2] - z) < 2) & (middle[:, 0] < 37)).sum())


@pytest.mark.parametrize("cuts", [(0.0, 60.0, LENGTH), (0.0, 52.0, 80.0, LENGTH)])
def test_pieces_meet_without_a_gap(cuts):
    surfaces, unjoined = pieces(*cuts)
    assert unjoined == 0
    whole = weld(surfaces)
    for z in cuts[1:-1]:
        assert open_at(whole, z) == 0
    on_cut = [s.vertex_p[s.locked & (s.vertex_p[:, 0] < 37)] for s in surfaces]
    assert all(len(p) > 50 for p in on_cut)
    assert {tuple(v) for v in on_cut[0]} <= {tuple(v) for v in on_cut[1]}


def test_the_model_has_no_gap_where_pieces_meet(monkeypatch):
    monkeypatch.setattr("stages.mesh.poisson._LARGEST_DEPTH", 6)  # of this cell size, for pieces of 40 mm
    along, axis = drawn()
    wall = Wall(along.cloud, small_wall(length_mm=LENGTH, columns=90).radius_map, axis)
    colours = overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters())
    parameters = MeshParameters(
        surface="poisson",
        poisson_cell_mm=CELL,
        poisson_reach_mm=REACH,
        tile_mm=40.0,
        texel_mm=1.0,
        triangles_per_mm2=0.3,
        error_mm=0.2,
    )
    numbers = {}
    context = replace(quiet_context(), report=lambda name, value, unit="": numbers.update({name: value}))
    mesh = make_mesh(wall, smooth_photo(length_mm=LENGTH), colours, parameters, context)
    assert numbers["mesh: borders between pieces that do not meet"] == 0
    assert mesh.triangles < 0.9 * mesh.wall_triangles  # decimated, and still without a gap
    tiles = [Surface(t.vertex_p, t.face, np.ones(len(t.vertex_p), bool)) for t in mesh.tiles]
    whole = weld(tiles)
    first, last = float(along.nearest_mm.min()), float(along.farthest_mm.max())
    cuts = piece_cuts(first, last, 40.0, CELL)
    assert len(cuts) == 4
    assert [open_at(whole, z) for z in cuts[1:-1]] == [0, 0]


def test_pieces_that_are_only_clipped_leave_gaps():
    along, _ = drawn()
    halves = []
    for first, last, way in ((0.0, 60.0, -1.0), (60.0, LENGTH, 1.0)):
        cloud = along.between(first - 25, last + 25)
        mesh = poisson_surface(cloud.xyz_p, cloud.normal_p, CELL, REACH)
        halves.append(clip(mesh, 60.0 * UP, way * UP)[0])
    assert open_at(weld([seen_part(h, REACH) for h in halves]), 60.0) > 50


def test_the_surface_equals_that_of_one_piece():
    def misfit(surfaces):
        scene = open3d().t.geometry.RaycastingScene()
        for s in surfaces:
            scene.add_triangles(s.vertex_p.astype(np.float32), s.face.astype(np.uint32))
        far = scene.compute_distance(drawn()[0].cloud.xyz_p).numpy()
        return np.quantile(far, [0.5, 0.99, 0.9999])

    whole, cut = misfit(pieces(0.0, LENGTH)[0]), misfit(pieces(0.0, 60.0, LENGTH)[0])
    # noise of 0.05 mm is the distance of points from either surface; at the branch's edge a quarter of a
    # cell, as
    # the octrees of the pieces differ from that of the whole
    assert np.all(np.abs(cut - whole) < [0.01, 0.05, CELL / 4])


def test_triangles_at_a_joint_have_the_orientation_of_all_others():
    surfaces, _ = pieces(0.0, 60.0, LENGTH)
    for s in surfaces:
        a, b, c = np.moveaxis(s.vertex_p[s.face], 1, 0)
        near = (np.abs((a + b + c)[:, 2] / 3 - 60) < 2) & ((a + b + c)[:, 0] < 0)  # no branch on this side
        inward = np.einsum("ti,ti->t", np.cross(b - a, c - a)[near], -(a + b + c)[near] * [1, 1, 0])
        area = np.linalg.norm(np.cross(b - a, c - a)[near], axis=1)
        assert near.sum() > 50
        assert np.all(inward[area > 1e-3] > 0)


def test_edges_without_a_partner_at_a_joint_are_counted_and_not_moved():
    tube, other = _tube(10.0, 0.0), _tube(10.0, 40.0)
    first, first_cut = clip(tube, 20.0 * UP, -UP)
    second, second_cut = clip(other, 20.0 * UP, UP)
    a, b, unjoined = join(first, first_cut, second, second_cut, 1.0)
    assert unjoined == 2
    assert a is first
    assert b is second


def test_an_unmeasured_stretch_is_a_hole_between_pieces():
    along, axis = drawn()
    empty = OpenMesh(np.empty((0, 3)), np.empty(0), np.empty((0, 3), np.int64), np.empty(0, bool))
    tube = _tube(25.0, 0.0)
    made = iter([tube, empty, tube])
    found = list(joined_pieces(along, axis, np.array([0.0, 40.0, 80.0, LENGTH]), lambda cloud: next(made)))
    assert [unjoined for _, unjoined in found] == [1, 0, 0] or [u for _, u in found] == [1, 1, 0]
    assert len(seen_part(found[1][0], REACH).face) == 0
    assert len(seen_part(found[0][0], REACH).face) > 0


def test_no_piece_is_too_large_for_the_finest_octree():
    assert len(piece_cuts(0.0, 300.0, 100.0, 0.5)) == 2
    cuts = piece_cuts(0.0, 100_000.0, 100.0, 0.5)
    assert np.diff(cuts).max() + 50 <= 1024 * 0.5 / 1.1
    assert len(cuts) < 300


def _tube(radius, x):
    """Return a tube from z = -5 to 125 whose triangles face inward."""
    psi, z = np.linspace(0, 2 * np.pi, 40, endpoint=False), np.arange(-5.0, 126.0, 5.0)
    i, j = (g.ravel() for g in np.meshgrid(np.arange(len(z) - 1), np.arange(40), indexing="ij"))
    a, b, c, d = i * 40 + j, i * 40 + (j + 1) % 40, (i + 1) * 40 + j, (i + 1) * 40 + (j + 1) % 40
    zz, pp = (g.ravel() for g in np.meshgrid(z, psi, indexing="ij"))
    vertex = np.stack([x + radius * np.cos(pp), radius * np.sin(pp), zz], -1)
    face = np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)])
    return OpenMesh(vertex, np.zeros(len(vertex)), face, np.zeros(len(vertex), bool))
