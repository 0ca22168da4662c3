"""Walls that fold over: recognised in the cloud, reconstructed by screened Poisson, within a time limit."""

import numpy as np
import pytest

from pipeline.artefacts.measured import Wall
from pipeline.artefacts.model import TexturedMesh
from pipeline.errors import UnusableError
from pipeline.system.native import open3d
from stages.mesh import MeshParameters, make_mesh
from stages.mesh.poisson import folded_cells
from stages.overlays import OverlayParameters, overlays_of
from tests.quiet import quiet_context
from tests.unit.small_wall import RADIUS, small_wall, smooth_photo, tee


def meshed_tee(parameters: MeshParameters) -> TexturedMesh:
    cloud, axis = tee()
    wall = Wall(cloud, small_wall().radius_map, axis)
    colours = overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters())
    return make_mesh(wall, smooth_photo(), colours, parameters, quiet_context())


def test_a_branch_is_reconstructed_by_poisson_within_its_limit() -> None:
    cloud, _ = tee()
    mesh = meshed_tee(MeshParameters(time_limit_s=120.0))
    assert mesh.surface == "poisson"
    scene = open3d().t.geometry.RaycastingScene()
    for tile in mesh.tiles:
        scene.add_triangles(tile.vertex_p, tile.face.astype(np.uint32))
    far = scene.compute_distance(cloud.xyz_p).numpy()
    assert np.quantile(far, 0.99) < 0.2
    vertex = np.concatenate([t.vertex_p for t in mesh.tiles])
    assert vertex[:, 0].max() > 40


def test_poisson_is_stopped_at_its_time_limit() -> None:
    with pytest.raises(UnusableError, match="longer than"):
        meshed_tee(MeshParameters(surface="poisson", time_limit_s=1.0, poisson_cell_mm=0.05))


def test_only_a_wall_that_folds_over_counts_as_folded() -> None:
    assert folded_cells(tee()[0], 2.0, 0.35) >= 20
    assert folded_cells(small_wall(noise_mm=0.05).cloud, 2.0, 0.35) == 0
