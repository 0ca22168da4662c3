"""Assembles the flat picture: tiles are opened by their first view and blended after their last."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Byte
from pipeline.geometry.image_places import ImagePlaces
from pipeline.instrument.probe import Probe
from pipeline.machine.scratch import Scratch
from pipeline.recording.images import SplitImage
from stages.texture.blend import TileStack
from stages.texture.grid import FlatGrid
from stages.texture.photometry import Light
from stages.texture.project import project_tile
from stages.texture.surface import SurfacePatch, WallSurface
from stages.texture.views import LitViews, TileViews


@dataclass(frozen=True)
class Blended:
    """Blended colours and sample counts of all pixels.

    Attributes
    ----------
    colour : (H, W, 3) uint16
        Reflectance in units of 1 / `REFLECTANCE_SCALE` grey level.
    count : (H, W) uint8
        Number of samples of each pixel.
    """

    colour: NDArray[np.uint16]
    count: Byte

    @staticmethod
    def empty(grid: FlatGrid, scratch: Scratch) -> Blended:
        """Return storage for the picture of a grid."""
        shape = (grid.rows, grid.columns)
        return Blended(scratch.zeros((*shape, 3), np.uint16), scratch.zeros(shape, np.uint8))


class Mosaic:
    """Samples the views of some tiles into a picture; holds samples only of the tiles in view."""

    def __init__(
        self,
        grid: FlatGrid,
        surface: WallSurface,
        probe: Probe,
        views: LitViews,
        plan: Sequence[TileViews],
        tiles: range,
        light: Light,
        laser_band_mm: float,
        left_out: ImagePlaces,
        picture: Blended,
    ) -> None:
        self._grid, self._surface, self._probe = grid, surface, probe
        self._views, self._plan, self._light, self._band = views, plan, light, laser_band_mm
        self._left_out = left_out
        self._tiles = grid.tiles()
        self._tiles_of: dict[int, list[int]] = defaultdict(list)
        for tile in tiles:
            for view in plan[tile].views:
                self._tiles_of[int(view)].append(tile)
        self._open: dict[int, tuple[SurfacePatch, TileStack]] = {}
        self._spare: list[TileStack] = []
        self._most_views = max((len(plan[tile].views) for tile in tiles), default=0)
        self._picture = picture

    def fill(self, images: Iterator[tuple[int, SplitImage | None]], threads: int) -> None:
        """Sample views, in order, into every tile that uses them; None stands for a missing image.

        A tile takes its views one after the other, but does not wait for other tiles: two views at a time are
        processed.
        """
        latest: dict[int, Future[None]] = {}
        before: list[Future[None]] = []
        with ThreadPoolExecutor(threads) as pool:
            for view, image in images:
                tiles = self._tiles_of[view]
                for tile in tiles:
                    self._ensure_open(tile)
                    latest[tile] = pool.submit(self._take, tile, view, image, latest.get(tile))
                _wait(before)
                before = [latest[tile] for tile in tiles]
            _wait(before)

    def _ensure_open(self, tile: int) -> None:
        if tile not in self._open:
            patch = self._grid.node_patch(self._tiles[tile], self._surface)
            if not self._spare:
                self._spare.append(TileStack(self._most_views, self._grid.tile_rows, self._grid.columns))
            self._open[tile] = patch, self._spare.pop()

    def _take(self, tile: int, view: int, image: SplitImage | None, before: Future[None] | None) -> None:
        """Sample a view into a tile after the view before, and blend the tile after its last view."""
        if before is not None:
            before.result()
        if image is not None and np.isfinite(self._light.gain[view]):
            self._sample(tile, view, image)
        if self._plan[tile].views[-1] == view:
            self._close(tile)

    def _sample(self, tile: int, view: int, image: SplitImage) -> None:
        patch, stack = self._open[tile]
        gap = self._band if self._views.laser_on[view] else 0.0
        stack.add(
            image,
            project_tile(
                patch, self._views.T_cp[view], self._probe, self._light.field,
                float(self._light.gain[view]), self._plan[tile].reach_mm, gap, self._left_out,
            ),
        )  # fmt: skip

    def _close(self, tile: int) -> None:
        stack = self._open.pop(tile)[1]
        colour, count = stack.blend()
        self._spare.append(stack)
        rows = slice(self._tiles[tile].first_row, self._tiles[tile].last_row)
        inside = rows.stop - rows.start
        self._picture.colour[rows], self._picture.count[rows] = colour[:inside], count[:inside]


def _wait(tasks: Sequence[Future[None]]) -> None:
    for task in tasks:
        task.result()
