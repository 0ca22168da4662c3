"""The stage: plan the views, separate light from wall, blend."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from pydantic import Field

from pipeline.artefacts import Int, Trajectory, Wall, WallTexture
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Image, Recording
from pipeline.stage import Context, Parameters
from stages.texture.grid import FlatGrid, flat_grid
from stages.texture.mosaic import Mosaic
from stages.texture.photometry import Light, solve_light
from stages.texture.sampling import LightSampler
from stages.texture.surface import wall_surface
from stages.texture.views import LitViews, TileViews, lit_views, plan_tiles

_WHITE = 250.0


class TextureParameters(Parameters):
    """Parameters of the stage texture."""

    oversampling: float = Field(
        1.0,
        ge=0.25,
        le=4.0,
        description="pixels of the flat picture per camera pixel on the wall at the ring",
    )
    reach_radii: float = Field(
        0.5, ge=0.02, le=1.0, description="wall used on either side of the laser sheet, in pipe radii"
    )
    most_views: int = Field(48, ge=3, le=64, description="most frames blended into one place")
    tile_mm: float = Field(10.0, ge=1.0, le=200.0, description="length of the tiles worked on, mm")
    smoothing_mm: float = Field(0.2, ge=0.0, le=10.0, description="1 σ of the radius map's smoothing, mm")
    shading_mm: float = Field(0.4, ge=0.1, le=20.0, description="1 σ of the wall slopes' smoothing, mm")
    laser_band_mm: float = Field(
        1.0, ge=0.0, le=20.0, description="half width left out about the laser line when it is on, mm"
    )
    white_quantile: float = Field(
        0.9995, ge=0.5, le=1.0, description="quantile of the brightest colour that becomes 250 of 255"
    )


def photograph_wall(
    recording: Recording,
    probe: Probe,
    trajectory: Trajectory,
    wall: Wall,
    parameters: TextureParameters,
    context: Context,
) -> WallTexture:
    """Return the wall's reflectance as a flat picture; where no lit frame shows it, alpha is 0."""
    surface = wall_surface(wall, parameters.smoothing_mm, parameters.shading_mm)
    grid = flat_grid(surface, probe, parameters.oversampling, parameters.tile_mm)
    views = lit_views(recording, trajectory)
    reach = parameters.reach_radii * surface.mean_radius_mm
    plan = plan_tiles(grid, surface, views, probe.laser, reach, parameters.most_views)
    images = _Images(recording, views, plan, context)

    sampler = LightSampler(surface, probe, views, reach, parameters.laser_band_mm)
    for view, image in images.read():
        sampler.add(view, image)
    light = solve_light(sampler.samples(), len(views.frame), probe, sampler.reference)
    _report_light(light, images.wanted, context)

    mosaic = Mosaic(grid, surface, probe, views, plan, light, parameters.laser_band_mm)
    with ThreadPoolExecutor(context.workers) as pool:
        for view, image in images.read():
            mosaic.add(view, image, pool)
    return _flat_picture(mosaic, grid, parameters.white_quantile, context)


class _Images:
    """The frames that some tile wants, read twice: for the light and for the picture."""

    def __init__(
        self, recording: Recording, views: LitViews, plan: Sequence[TileViews], context: Context
    ) -> None:
        self._recording, self._views, self._context = recording, views, context
        chosen = [tile.views for tile in plan]
        self.wanted: Int = np.unique(np.concatenate(chosen)) if chosen else np.zeros(0, np.int64)
        self._done = 0

    def read(self) -> Iterator[tuple[int, Image | None]]:
        """Yield (view, image) in order; None where a frame cannot be decoded."""
        frames = self._views.frame[self.wanted]
        for view, (_, image) in zip(self.wanted, self._recording.read(frames, "bgr"), strict=True):
            yield int(view), image
            self._done += 1
            self._context.progress(self._done, 2 * len(self.wanted))


def _report_light(light: Light, wanted: Int, context: Context) -> None:
    gain = light.gain[wanted]
    rejected = int(np.isnan(gain).sum())
    context.report("lit frames used for the texture", len(gain) - rejected, "frames")
    context.report("rejected: lit frames too dark, clipped or unreadable", rejected, "frames")
    context.report("photometric residual", light.residual, "relative")
    if rejected < len(gain):
        context.report("spread of exposure between frames", float(np.nanstd(np.log(gain))), "relative")
    else:
        context.logger.warning("no lit frame shows the wall: the model has no texture")


def _flat_picture(mosaic: Mosaic, grid: FlatGrid, white_quantile: float, context: Context) -> WallTexture:
    """Scale by one common gain to 8 bits."""
    seen = mosaic.count > 0
    brightest = mosaic.colour.max(2)[seen]
    white = float(np.quantile(brightest, white_quantile)) if brightest.size else 1.0
    bgra = np.zeros((*seen.shape, 4), np.uint8)
    for rows in range(0, grid.rows, grid.tile_rows):
        part = slice(rows, rows + grid.tile_rows)
        bgra[part, :, :3] = np.minimum(mosaic.colour[part] * np.float32(_WHITE / white) + 0.5, 255)
    bgra[..., 3] = np.where(seen, 255, 0)
    context.report("wall textured", float(seen.mean()), "fraction")
    context.report("views behind a pixel, median", float(np.median(mosaic.count)), "views")
    return WallTexture(bgra, grid.distance_from_mm, grid.mm_per_px, grid.azimuth_from_rad, grid.rad_per_px)
