"""Fits a surface of few triangles to a radius map, with more vertices where the wall needs them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.sparse import csr_matrix

from pipeline.arrays import Bool, Float, Float32, Int, Int32
from pipeline.artefacts.measured import Wall
from pipeline.geometry.axis import PipeAxis, frames_at, from_pipe
from stages.mesh.bisection import Cuts, Lattice, beside_holes, triangles, without_gaps, worthwhile
from stages.mesh.surface import Decimated, Surface

# Steps of the conjugate gradients: the matrix, scaled by its diagonal, has eigenvalues between 1/2 and 2
# (A. Wathen, "Realistic eigenvalue bounds for the Galerkin mass matrix", 1987): each removes two thirds.
_STEPS = 14
# Scatter of cells without noise, as a share of the bound ``error_mm`` (chosen).
_SCATTER = 0.25


@dataclass(frozen=True)
class Cells:
    """The radius map on the nodes of its lattice, row by row, and the largest error of a surface through it.

    Attributes
    ----------
    radius_mm, noise_mm : (nodes,) float32
        Radius and its random 1 σ; 0 where nothing was measured.
    distance_mm, origin_p, frame : (R,), (R, 3), (R, 3, 3)
        Distance along the axis, and the axis' point and frame in P, at every row.
    azimuth_rad : (A,)
    error_mm, noise_factor : float
        The surface may differ from a cell by ``error_mm`` plus ``noise_factor`` times its noise.
    """

    lattice: Lattice
    radius_mm: Float32
    noise_mm: Float32
    distance_mm: Float
    origin_p: Float
    frame: Float
    azimuth_rad: Float
    error_mm: float
    noise_factor: float

    def sigma_mm(self, node: Int | slice) -> Float:
        """Return the 1 σ that weights cells."""
        return np.asarray(np.hypot(self.noise_mm[node].astype(float), _SCATTER * self.error_mm))

    def outward(self, rows: slice) -> Float:
        """Return unit vectors (R, A, 3) from the axis to the wall at the nodes of some rows."""
        psi, frame = self.azimuth_rad[:, None], self.frame[rows, None]
        return np.asarray(frame[..., 0] * np.cos(psi) + frame[..., 1] * np.sin(psi))


def cells_of(wall: Wall, error_mm: float, noise_factor: float) -> Cells:
    """Return a wall's cells; a surface may differ by ``error_mm`` plus ``noise_factor`` times their 1 σ."""
    found = wall.radius_map
    rows, columns = found.radius_mm.shape
    lattice = Lattice(rows, columns)
    step = (found.distance_mm[-1] - found.distance_mm[0]) / max(rows - 1, 1)
    distance = found.distance_mm[0] + step * np.arange(lattice.nodes // columns)
    distance[:rows] = found.distance_mm
    radius, noise = np.zeros((2, lattice.nodes), np.float32)
    radius[: rows * columns] = np.nan_to_num(found.radius_mm.ravel())
    noise[: rows * columns] = np.nan_to_num(found.sigma_random_mm.ravel())
    axis = frames_at(wall.axis, distance)
    return Cells(lattice, radius, noise, distance, *axis, found.azimuth_rad, error_mm, noise_factor)


def fitted_surface(cells: Cells, axis: PipeAxis, pieces: int, triangle_cost: float) -> Iterator[Decimated]:
    """Yield the wall's surface in pieces, in order of distance, that share the vertices where they meet.

    Triangles are cut where that reduces χ² by more than they cost, and where a cell is too far off.
    """
    lattice = cells.lattice
    wanted = _joined([worthwhile(lattice, *_in_blocks(cells, s), triangle_cost) for s in lattice.slabs()])
    vertex, more = None, np.zeros(lattice.nodes, bool)
    while vertex is None or (more > vertex).any():
        vertex = more
        cuts = without_gaps(lattice, wanted, vertex)
        radius, off = _fit(cells, cuts)
        beyond = np.abs(off) > cells.error_mm + cells.noise_factor * cells.noise_mm
        more = vertex | _with_neighbours(beyond, lattice.columns)
    for along in _rows_of_blocks(lattice, pieces):
        yield _piece(cells, cuts, radius, off, axis, along)


def _rows_of_blocks(lattice: Lattice, pieces: int) -> list[slice]:
    """Return slices that cut a lattice in pieces."""
    cut = np.unique(np.rint(np.linspace(0, lattice.blocks[0], pieces + 1)).astype(int))
    return [slice(int(a), int(b)) for a, b in pairwise(cut)]


def _joined(slabs: list[Cuts]) -> Cuts:
    """Return the cuts of all blocks."""
    cut, whole = ([np.concatenate(level, axis=1) for level in zip(*part, strict=True)] for part in (
        [s.cut for s in slabs], [s.whole for s in slabs]
    ))  # fmt: skip
    return Cuts(cut, whole)


def _with_neighbours(node: Bool, columns: int) -> Bool:
    """Return the nodes and the eight around each."""
    ring = np.pad(node.reshape(-1, columns), ((0, 0), (1, 1)), mode="wrap")
    return np.asarray(binary_dilation(ring, np.ones((3, 3), bool))[:, 1:-1].ravel())


def _in_blocks(cells: Cells, along: slice) -> tuple[Float, Float]:
    """Return the nodes of blocks (n, n, N, 3), mm along the block's plane and over it, and their weights."""
    lattice, n = cells.lattice, cells.lattice.block
    (row, column), step = lattice.origin(along), np.arange(n + 1)[:, None]
    rows, columns = (row + step)[:, None], ((column + step) % lattice.columns)[None]
    node, first = rows * lattice.columns + columns, along.start * n
    outward = cells.outward(slice(first, along.stop * n + 1))
    radius = cells.radius_mm[node].astype(float)
    seen = radius > 0
    xyz = cells.origin_p[rows] + radius[..., None] * outward[rows - first, columns]
    normal, ahead = outward[rows - first, columns][n // 2, n // 2], cells.frame[row + n // 2, :, 2]
    plane = np.stack([ahead, np.cross(ahead, normal), normal], 1)
    middle = radius.sum((0, 1)) / np.maximum(seen.sum((0, 1)), 1)
    centre = cells.origin_p[row + n // 2] + middle[:, None] * normal
    return np.einsum("nij,abnj->abni", plane, xyz - centre), seen / cells.sigma_mm(node) ** 2


def _fit(cells: Cells, cuts: Cuts) -> tuple[Float, Float32]:
    """Return the radius (nodes,) of each vertex, and the distance of each cell (nodes,) outside the surface.

    Radii are the weighted least-squares solution over all cells, some rows of blocks after the other, each
    with the next row of blocks, on which it hardly depends.
    """
    lattice = cells.lattice
    radius, off = cells.radius_mm.astype(float), np.zeros(lattice.nodes, np.float32)
    for along in lattice.slabs():
        ahead = slice(along.start, min(along.stop + 1, lattice.blocks[0]))
        here, own = (lattice.of_rows(part) for part in (ahead, along))
        known = lattice.columns if along.start else 0  # the row that the blocks before have fitted
        node, vertex, weight, shift = _equations(cells, cuts, ahead)
        wanted = cells.radius_mm[here][node] - shift
        found = _least_squares(radius[here], wanted, 1 / cells.sigma_mm(here)[node], vertex, weight, known)
        mine = node < own.stop - own.start
        radius[own] = found[: own.stop - own.start]
        off[own.start + node[mine]] = (wanted - (weight * found[vertex]).sum(1))[mine]
    return radius, off


def _equations(cells: Cells, cuts: Cuts, along: slice) -> tuple[Int, Int, Float, Float]:
    """Return the linear equations of the surface at each cell in terms of its vertices.

    The surface's radius at node (M,) is the sum over its triangle's vertices (M, 3) of weight (M, 3) times
    radius, plus shift (M,); displacements along a triangle by its slope are neglected. Nodes are counted from
    the first of these rows of blocks.
    """
    lattice = cells.lattice
    owner, level = _owners(lattice, cuts, along)
    finest = lattice.corner[lattice.finest]
    region, columns = lattice.of_rows(along), lattice.columns
    number = lattice.number(finest, along) - region.start
    pick = np.full(region.stop - region.start, -1)
    covered = np.broadcast_to((level >= 0)[:, None], number.shape)
    pick[number[covered]] = np.flatnonzero(covered)
    node = np.flatnonzero(pick >= 0)
    half, corner, block = np.unravel_index(pick[node], number.shape)
    start = np.cumsum([0, *(len(c) for c in lattice.corner)])
    place = np.concatenate(lattice.corner)[start[level[half, block]] + owner[half, block]]
    share = _barycentric(finest[half, corner], place)
    first, around = (origin[block] for origin in lattice.origin(along))
    first = first - along.start * lattice.block
    vertex = (first[:, None] + place[..., 0]) * columns + (around[:, None] + place[..., 1]) % columns
    rows = slice(along.start * lattice.block, along.stop * lattice.block + 1)
    outward, origin = cells.outward(rows).reshape(-1, 3), cells.origin_p[rows]
    here = outward[node]
    weight = share * np.einsum("mki,mi->mk", outward[vertex], here)
    away = origin[vertex // columns] - origin[node // columns][:, None]
    return node, vertex, weight, (share * np.einsum("mki,mi->mk", away, here)).sum(1)


def _owners(lattice: Lattice, cuts: Cuts, along: slice) -> tuple[Int, Int]:
    """Return number and level (T, N) of the triangle that contains each half square; level −1: none."""
    blocks = lattice.of_blocks(along)
    level_of = np.full((len(lattice.corner[-1]), blocks.stop - blocks.start), -1)
    for level in range(lattice.finest + 1):
        leaf = np.repeat(cuts.leaves(level, blocks), 1 << (lattice.finest - level), axis=0)
        level_of[leaf] = level
    half = np.arange(len(level_of))[:, None]
    return half >> (lattice.finest - level_of), level_of


def _barycentric(place: Int32, corner: Int32) -> Float:
    """Return the weights (M, 3) of triangles' corners (M, 3, 2) at places (M, 2)."""
    a, b, p = (x - corner[:, 0] for x in (corner[:, 1], corner[:, 2], place))
    double = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    u = (p[:, 0] * b[:, 1] - p[:, 1] * b[:, 0]) / double
    v = (a[:, 0] * p[:, 1] - a[:, 1] * p[:, 0]) / double
    return np.stack([1 - u - v, u, v], -1)


def _least_squares(
    radius: Float, wanted: Float, weight: Float, vertex: Int, share: Float, known: int
) -> Float:
    """Return ``radius`` (nodes,) with those vertices fitted whose number is ``known`` or higher.

    For each cell (M,), ``share`` (M, 3) times its vertices' radii should be ``wanted``, with ``weight``.
    M. Hestenes, E. Stiefel, "Methods of conjugate gradients", 1952, scaled by the diagonal.
    """
    used = np.zeros(len(radius), bool)
    used[vertex] = True
    place = np.cumsum(used) - 1
    matrix = csr_matrix(
        ((share * weight[:, None]).ravel(), place[vertex].ravel(), np.arange(0, vertex.size + 1, 3)),
        (len(vertex), int(used.sum())),
    )
    transposed = matrix.T.tocsr()
    number = np.flatnonzero(used)
    scale = np.where(number >= known, 1 / (transposed.multiply(transposed) @ np.ones(len(vertex))), 0.0)
    x = radius[number]
    residual = transposed @ (wanted * weight - matrix @ x)
    step, size = scale * residual, residual @ (scale * residual)
    for _ in range(_STEPS):
        if size == 0:
            break
        product = transposed @ (matrix @ step)
        length = size / (step @ product)
        x, residual = x + length * step, residual - length * product
        before, size = size, residual @ (scale * residual)
        step = scale * residual + size / before * step
    fitted = radius.copy()
    fitted[number] = x
    return fitted


def _piece(cells: Cells, cuts: Cuts, radius: Float, off: Float32, axis: PipeAxis, along: slice) -> Decimated:
    """Return some rows of blocks as a surface with its errors; its first row counts in the piece before."""
    lattice = cells.lattice
    measured = cells.radius_mm > 0
    node, corner = np.unique(triangles(lattice, cuts, measured, along), return_inverse=True)
    row, column = node // lattice.columns, node % lattice.columns
    xyz = from_pipe(axis, cells.distance_mm[row], cells.azimuth_rad[column], radius[node])
    first, last = along.start * lattice.block, along.stop * lattice.block
    border = ((row == first) & (first > 0)) | ((row == last) & (along.stop < lattice.blocks[0]))
    mine = slice((first + (first > 0)) * lattice.columns, (last + 1) * lattice.columns)
    error, count = off[mine].astype(float), int(measured[mine].sum())
    whole = cuts.whole[-1][:, lattice.of_blocks(along)].sum()
    return Decimated(
        Surface(xyz, corner.reshape(-1, 3).astype(np.int32), border),
        int(whole) + len(beside_holes(lattice, measured, along)),
        count,
        float(np.abs(error).max(initial=0.0)),
        float((error**2).sum() / max(count, 1)),
    )
