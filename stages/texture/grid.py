"""The flat picture's pixels on the wall, cut into tiles along the distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.probe import Probe
from stages.texture.surface import SurfacePatch, WallSurface

NODE_PX = 8


@dataclass(frozen=True)
class Tile:
    """Rows ``first_row`` to ``last_row`` (exclusive) of the flat picture."""

    first_row: int
    last_row: int


@dataclass(frozen=True)
class FlatGrid:
    """Rows along the distance, columns along the azimuth from −π.

    Attributes
    ----------
    distance_from_mm, mm_per_px : float
        Row i's centre is at ``distance_from_mm + i * mm_per_px``.
    rows, columns : int
        ``columns`` is a multiple of `NODE_PX`.
    tile_rows : int
        Rows of a tile, a multiple of `NODE_PX`; the last tile may reach beyond the picture.
    """

    distance_from_mm: float
    mm_per_px: float
    rows: int
    columns: int
    tile_rows: int

    @property
    def rad_per_px(self) -> float:
        """Azimuth from one column to the next."""
        return 2 * np.pi / self.columns

    @property
    def azimuth_from_rad(self) -> float:
        """Azimuth of the first column's centre."""
        return -np.pi

    def tiles(self) -> list[Tile]:
        """Return the tiles in the order of distance."""
        first = range(0, self.rows, self.tile_rows)
        return [Tile(row, min(row + self.tile_rows, self.rows)) for row in first]

    def centre_mm(self, tile: Tile) -> float:
        """Return the distance of a tile's middle."""
        return self.distance_from_mm + self.mm_per_px * (tile.first_row + (self.tile_rows - 1) / 2)

    def node_patch(self, tile: Tile, surface: WallSurface) -> SurfacePatch:
        """Return the wall at the tile's nodes, one in `NODE_PX` pixels, with one more all round.

        Enlarging the nodes by `NODE_PX` with cv2.resize gives the pixels' centres.
        """
        rows = tile.first_row + self._nodes(self.tile_rows)
        azimuth = self.azimuth_from_rad + self.rad_per_px * self._nodes(self.columns)
        return surface.patch(self.distance_from_mm + self.mm_per_px * rows, azimuth)

    @staticmethod
    def _nodes(size: int) -> Float:
        return np.asarray((np.arange(-1, size // NODE_PX + 1) + 0.5) * NODE_PX - 0.5)


def flat_grid(surface: WallSurface, probe: Probe, oversampling: float, tile_mm: float) -> FlatGrid:
    """Return a grid whose square pixels cover as much wall as the camera's pixels at the laser ring.

    Parameters
    ----------
    surface
        The wall; the grid covers the rows that the ring saw.
    probe
        Its camera and laser sheet give the footprint of a pixel on the wall.
    oversampling
        Grid pixels per camera pixel.
    tile_mm
        Requested length of a tile.
    """
    radius = surface.mean_radius_mm
    spacing = footprint_mm(probe, radius) / oversampling
    columns = NODE_PX * int(np.ceil(2 * np.pi * radius / spacing / NODE_PX))
    spacing = 2 * np.pi * radius / columns
    first, last = surface.seen_mm
    tile_rows = NODE_PX * max(1, round(tile_mm / spacing / NODE_PX))
    return FlatGrid(first, spacing, 1 + int((last - first) / spacing), columns, tile_rows)


def footprint_mm(probe: Probe, radius_mm: float) -> float:
    """Return the root of the wall area that a camera pixel covers at the laser ring, mean around the ring."""
    psi = np.linspace(-np.pi, np.pi, 36, endpoint=False)
    c, s, zero = np.cos(psi), np.sin(psi), 0 * psi
    height = probe.laser.height(psi) + radius_mm * probe.laser.slope(psi)
    by_point = probe.camera.project_jacobian(np.stack([radius_mm * c, radius_mm * s, height], -1)).by_point
    around = np.einsum("nij,nj->ni", by_point, np.stack([-s, c, zero], -1))
    along = by_point[..., 2]
    density = np.abs(around[:, 0] * along[:, 1] - around[:, 1] * along[:, 0])
    return float(1 / np.sqrt(density.mean()))
