"""Estimates the noise of the lit pictures, and the number of them that the photo therefore averages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float32, Image, Int
from pipeline.geometry.image_places import ImagePlaces
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording
from pipeline.recording.decoded_once import read_luma
from stages.texture.grid import FlatGrid, Tile
from stages.texture.light import LightField
from stages.texture.project import project_tile
from stages.texture.surface import WallSurface
from stages.texture.views import LitViews, TileViews

_ROUNDED = 1 / np.sqrt(12)
"""1 σ, grey levels, of the photo's rounding to 8 bits: noise below it is not visible."""
_FEWEST = 16
"""Number of views blended even without noise, so that a glint or a drop in some of them is distinguished from
the wall. In open-1-field 16 instead of 48 views cost 0.1 dB of 44.7, 24 cost 0.04 dB."""
_TILES, _ROWS = 8, 32
"""Number of tiles that are examined, and rows of each: 10^5 pixels a tile, whose spread is known to 1 %."""
_LIGHT_PX = 8.0
"""σ, px, over which brightness is equalised: exposure and light differ between views, but only broadly."""
_LEAST_SEEN = 1000
"""Number of pixels that determine a spread to 5 %."""


@dataclass(frozen=True)
class NoiseGauge:
    """Compares views of the same wall.

    Attributes
    ----------
    recording, probe, grid, surface, views
    reference : float
        Irradiance that counts as 1.
    laser_band_mm : float
        Half width left out around the laser line when it is on.
    left_out
        Places of the image that are not used.
    """

    recording: Recording
    probe: Probe
    grid: FlatGrid
    surface: WallSurface
    views: LitViews
    reference: float
    laser_band_mm: float
    left_out: ImagePlaces

    def noise(self, plan: Sequence[TileViews]) -> float:
        """Return 1 σ, grey levels, of the random differences between views; NaN if it cannot be estimated.

        Two views of a tile are compared that are a fifth of its views apart: compression gives neighbours
        the same errors, and distant ones show the wall with different sharpness.
        """
        tiles = np.unique(np.linspace(0, len(plan) - 1, _TILES + 2).astype(int)[1:-1])
        found = [self._between(int(t), _apart(plan[t].views), plan[t].reach_mm) for t in tiles]
        known = [f for f in found if np.isfinite(f)]
        return float(np.median(known)) if known else float("nan")

    def _between(self, tile: int, pair: Int, reach_mm: float) -> float:
        """Return the noise between two views of a tile; NaN where they share too little of it."""
        seen = list(self._seen(tile, pair, reach_mm))
        if len(seen) < 2:
            return float("nan")
        (one, in_one), (other, in_other) = seen
        apart = (one - other) / np.float32(np.sqrt(2))
        both = in_one & in_other
        fine = apart - cv2.GaussianBlur(apart, (0, 0), _LIGHT_PX)
        return robust_spread(fine[both]) if both.sum() >= _LEAST_SEEN else float("nan")

    def _seen(self, tile: int, pair: Int, reach_mm: float) -> Iterator[tuple[Float32, Bool]]:
        """Yield a tile's middle rows in each view, as if evenly lit, and the mask (rows, columns) of wall."""
        first = self.grid.tiles()[tile].first_row + max(self.grid.tile_rows - _ROWS, 0) // 2
        patch = replace(self.grid, tile_rows=_ROWS).node_patch(Tile(first, first + _ROWS), self.surface)
        field = LightField(self.probe.lighting, 0.0, 1.0, np.zeros((2, 1)), self.reference)
        images = read_luma(self.recording, self.views.frame[pair])
        for view, (_, luma) in zip(pair, images, strict=True):
            gap = self.laser_band_mm if self.views.laser_on[view] else 0.0
            at = project_tile(
                patch, self.views.T_cp[view], self.probe, field, 1.0, reach_mm, gap, self.left_out
            )
            if luma is not None:
                yield _evenly_lit(luma, at.uv, at.inverse_brightness), at.weight > 0


def _apart(views: Int) -> Int:
    """Return two of the views of a tile, or fewer if it does not have two."""
    return np.unique(views[[2 * len(views) // 5, 3 * len(views) // 5]]) if len(views) else views


def _evenly_lit(luma: Image, uv: Float32, inverse_brightness: Float32) -> Float32:
    grey = cv2.remap(luma, uv[..., 0], uv[..., 1], cv2.INTER_CUBIC).astype(np.float32)
    return grey * (inverse_brightness / np.median(inverse_brightness))


def views_against(noise: float, most: int) -> int:
    """Return the number of views whose mean has no more noise (1 σ, grey levels) than rounding.

    It is ``most`` at most, and ``most`` if the noise is unknown.
    """
    if not np.isfinite(noise):
        return most
    return min(max(int(np.ceil((noise / _ROUNDED) ** 2)), _FEWEST), most)
