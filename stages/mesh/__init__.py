"""The stage mesh makes a textured triangle mesh of the wall, its photo and the error colours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from pydantic import Field

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.measured import PointCloud, Wall, WallTexture
from pipeline.artefacts.model import Overlays, PackedTiles, TexturedMesh
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.system.parallel import CrashError, TimeLimitError, call_isolated
from stages.mesh.bake import TilePacker, bake_tile
from stages.mesh.charts import cut_charts, pack, tile_count, tile_length, unroll
from stages.mesh.fitted import cells_of, fitted_surface
from stages.mesh.join import OpenMesh
from stages.mesh.poisson import folded_cells, joined_pieces, piece_cuts, poisson_surface, seen_part
from stages.mesh.surface import Decimated, Surface, decimate, with_normals

# Rows and points from which medians are computed: a bound on time.
_SAMPLED_ROWS, _SAMPLED_POINTS = 2000, 1 << 20


class MeshParameters(Parameters):
    """Parameters of the surface, its decimation and its texture."""

    surface: Literal["auto", "grid", "poisson"] = Field(
        "auto",
        description="grid: fitted to the radius map; poisson: for walls that fold over; auto: by the cloud",
    )
    folded_cell_mm: float = Field(2.0, ge=0.5, le=20, description="mm; cells in which auto looks for folds")
    fold: float = Field(
        0.35, ge=0.05, le=5, description="spread of radii in a cell, per median radius, that is a fold"
    )
    least_folded_cells: int = Field(20, ge=1, description="cells with a fold from which auto takes poisson")
    poisson_cell_mm: float = Field(0.5, ge=0.05, le=10, description="mm; finest cell of the Poisson solver")
    poisson_reach_mm: float = Field(
        2.0, ge=0.1, le=50, description="mm; surface farther from every point is left out as not seen"
    )
    error_mm: float = Field(
        0.02,
        gt=0,
        le=5,
        description="mm; largest distance of the surface from the wall, beyond the wall's own noise",
    )
    noise_factor: float = Field(
        4.0,
        ge=0,
        le=6,
        description="number of random 1 σ of a cell that are added to error_mm; 0: the bound is strict",
    )
    # C. Mallows' criterion for the least error of prediction requires 2 per vertex, 1 per triangle, and two
    # to three times more since as many rows of a radius map share noise. Compared with truth, open-1 errs by
    # 14.3 µm with 3 (without bias), 14.3 with 10, 15.4 with 20.
    triangle_cost: float = Field(
        3.0, ge=0, le=1e6, description="least drop of χ² for each further triangle; higher: fewer triangles"
    )
    triangles_per_mm2: float = Field(
        2.0, gt=0, le=200, description="1/mm²; decimation of a Poisson surface stops at this density"
    )
    texel_mm: float = Field(0.1, ge=0.02, le=5, description="mm; size of a photo texel on the wall")
    tile_mm: float = Field(100.0, ge=10, le=1000, description="mm; length of the pieces the model is made of")
    atlas_px: int = Field(4096, ge=512, le=16384, description="px; largest side of a texture")
    time_limit_s: float = Field(
        600.0, ge=1, description="s; a reconstruction of one piece is stopped after this time"
    )


def make_mesh(
    wall: Wall, texture: WallTexture, overlays: Overlays, parameters: MeshParameters, context: Context
) -> TexturedMesh:
    """Return the wall as a textured mesh.

    Raises
    ------
    UnusableError
        When the wall has too few measured cells, or a library gave up or took longer than its limit.
    """
    kind = _choose_surface(wall, parameters, context)
    tile_mm = _tile_length(wall, parameters)
    if kind == "grid":
        pieces = _grid_pieces(wall, tile_mm, parameters, context)
    else:
        pieces = _poisson_pieces(wall, parameters, context)
    tally, packer = Tally(), TilePacker(context.scratch)
    for surface, normal in with_normals(map(tally.note, pieces)):
        unrolled = unroll(surface, wall.axis)
        for charts in cut_charts(unrolled, surface, tile_mm, parameters.texel_mm):
            atlas = pack(charts, parameters.texel_mm)
            packer.add(bake_tile(atlas, surface, normal, unrolled, texture, overlays, parameters.texel_mm))
    mesh = _assemble(packer.packed(), kind, tally, parameters)
    if mesh.triangles == 0:
        raise UnusableError("mesh", "no triangle could be made: too few measured cells lie side by side")
    _report(mesh, context)
    return mesh


@dataclass
class Tally:
    """Sums over the pieces: triangles and vertices before decimation, and their distance from the surface."""

    faces: int = 0
    vertices: int = 0
    largest_error_mm: float = 0.0
    square_mm2: float = 0.0

    def note(self, piece: Decimated) -> Surface:
        """Count a piece and return its surface."""
        self.faces += piece.original_faces
        self.vertices += piece.original_vertices
        self.largest_error_mm = max(self.largest_error_mm, piece.largest_error_mm)
        self.square_mm2 += piece.mean_square_mm2 * piece.original_vertices
        return piece.surface


def _choose_surface(wall: Wall, parameters: MeshParameters, context: Context) -> str:
    folded = folded_cells(wall.cloud, parameters.folded_cell_mm, parameters.fold)
    context.report("mesh: cells in which the wall folds over", folded)
    if parameters.surface != "auto":
        return parameters.surface
    return "poisson" if folded >= parameters.least_folded_cells else "grid"


def _tile_length(wall: Wall, parameters: MeshParameters) -> float:
    radius = wall.radius_map.radius_mm
    some = radius[:: max(len(radius) // _SAMPLED_ROWS, 1)]
    measured = some[np.isfinite(some)]
    if len(measured) == 0:
        raise UnusableError("mesh", "no cell of the wall was measured", hint="see the earlier warnings")
    return tile_length(
        parameters.tile_mm, float(np.median(measured)), parameters.texel_mm, parameters.atlas_px
    )


def _grid_pieces(
    wall: Wall, tile_mm: float, parameters: MeshParameters, context: Context
) -> Iterator[Decimated]:
    """Yield the radius map's surface in decimated pieces."""
    pieces = tile_count(float(np.ptp(wall.radius_map.distance_mm)), tile_mm)
    cells = cells_of(wall, parameters.error_mm, parameters.noise_factor)
    for done, piece in enumerate(fitted_surface(cells, wall.axis, pieces, parameters.triangle_cost), 1):
        yield piece
        context.progress(done, pieces)


def _poisson_pieces(wall: Wall, parameters: MeshParameters, context: Context) -> Iterator[Decimated]:
    """Yield the cloud's Poisson surface in decimated pieces."""
    along, noise = cloud_along(wall.cloud), _typical_sigma(wall.cloud)
    first, last = float(along.nearest_mm.min()), float(along.farthest_mm.max())
    cuts = piece_cuts(first, last, parameters.tile_mm, parameters.poisson_cell_mm)
    allowance, open_borders = parameters.error_mm + parameters.noise_factor * noise, 0

    reconstruct = partial(_reconstructed, parameters=parameters)
    for done, (mesh, unjoined) in enumerate(joined_pieces(along, wall.axis, cuts, reconstruct), 1):
        open_borders += unjoined
        yield _thin_out(seen_part(mesh, parameters.poisson_reach_mm), parameters, allowance)
        context.progress(done, len(cuts) - 1)
    context.report("mesh: borders between pieces that do not meet", open_borders)


def _reconstructed(cloud: PointCloud, parameters: MeshParameters) -> OpenMesh:
    """Return a cloud's Poisson surface, made in a separate process: the library may crash or never return."""
    xyz, normal = cloud.xyz_p.astype(float), cloud.normal_p.astype(float)
    limits = parameters.poisson_cell_mm, parameters.poisson_reach_mm
    try:
        return call_isolated(parameters.time_limit_s, poisson_surface, xyz, normal, *limits)
    except (TimeLimitError, CrashError) as error:
        hint = "set mesh.time_limit_s higher, or mesh.surface=grid, or mesh.poisson_cell_mm larger"
        raise UnusableError("mesh", f"screened Poisson: {error}", hint=hint) from error


def _typical_sigma(cloud: PointCloud) -> float:
    """Return the median 1 σ of a cloud, of a long one of some of its points."""
    return float(np.median(cloud.sigma_mm[:: max(len(cloud.sigma_mm) // _SAMPLED_POINTS, 1)]))


def _thin_out(surface: Surface, parameters: MeshParameters, allowance_mm: float) -> Decimated:
    """Return the surface decimated to the requested density, if its error allows."""
    a, b, c = np.moveaxis(surface.vertex_p[surface.face], 1, 0)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    target = max(1, round(parameters.triangles_per_mm2 * area))
    return decimate(surface, target, allowance_mm)


def _assemble(tiles: PackedTiles, kind: str, tally: Tally, parameters: MeshParameters) -> TexturedMesh:
    rms = float(np.sqrt(tally.square_mm2 / max(tally.vertices, 1)))
    return TexturedMesh(tiles, kind, parameters.texel_mm, tally.faces, tally.largest_error_mm, rms)


def _report(mesh: TexturedMesh, context: Context) -> None:
    context.report("mesh: surface", mesh.surface)
    context.report("mesh: triangles before thinning out", mesh.wall_triangles)
    context.report("mesh: triangles", mesh.triangles)
    context.report(
        "mesh: largest distance of the wall's points from the surface", mesh.decimation_error_mm, "mm"
    )
    context.report(
        "mesh: RMS distance of the wall's points from the surface, their noise included",
        mesh.decimation_rms_mm,
        "mm",
    )


MESH = Stage("mesh", "5", MeshParameters, make_mesh, "wall, photo, error colours -> textured mesh")
