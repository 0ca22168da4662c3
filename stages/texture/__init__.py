"""The stage texture makes the wall's photo from lit frames, motion and wall.

It chooses the views of each tile, separates light from wall, and blends the views.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from pydantic import Field

from pipeline.arrays import Int
from pipeline.artefacts.measured import Trajectory, Wall, WallTexture
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from pipeline.recording.decoded_once import read_luma, read_split
from pipeline.system.parallel import in_threads
from stages.texture.blend import REFLECTANCE_SCALE
from stages.texture.grid import FlatGrid, flat_grid
from stages.texture.mosaic import Blended, Mosaic
from stages.texture.noise import NoiseGauge, views_against
from stages.texture.photometry import LightChain, cut_plan
from stages.texture.sampling import LightSampler, joined
from stages.texture.surface import wall_surface
from stages.texture.views import LitViews, TileViews, lit_views, seen_by, shared, thinned

_WHITE = 250.0
# A place brighter than this many times the median wall is not matt wall, but a glint, or noise where light is
# scarce. Derived: dirty steel and concrete reflect .2, white lime and paint .8 of the light.
_MATT_RATIO = 4.0
Read = TypeVar("Read")
_Reader = Callable[[Recording, Int], Iterator[tuple[int, Read | None]]]


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
    most_views: int = Field(
        48, ge=3, le=64, description="most frames blended into one place; fewer if pictures have little noise"
    )
    tile_mm: float = Field(10.0, ge=1.0, le=200.0, description="length of the processed tiles, mm")
    smoothing_mm: float = Field(0.2, ge=0.0, le=10.0, description="1 σ of the radius map's smoothing, mm")
    shading_mm: float = Field(0.4, ge=0.1, le=20.0, description="1 σ of the wall slopes' smoothing, mm")
    laser_band_mm: float = Field(
        1.0, ge=0.0, le=20.0, description="half width left out around the laser line when it is on, mm"
    )
    views_at_once: int = Field(
        1500,
        ge=20,
        le=100000,
        description="frames whose light is estimated together; a run of more frames is divided in stretches",
    )
    left_out: tuple[tuple[float, float, float], ...] = Field(
        (),
        description="dirty places of the image that are not used, each as u, v and radius, px; "
        "boresight run --twin takes them from a twin",
    )
    white_quantile: float = Field(
        0.9995,
        ge=0.5,
        le=1.0,
        description="share of the wall whose brightest colour channel stays below 250 of 255",
    )


def photograph_wall(
    recording: Recording,
    probe: Probe,
    trajectory: Trajectory,
    wall: Wall,
    parameters: TextureParameters,
    context: Context,
) -> WallTexture:
    """Return the wall as a photo, evenly lit, as bright as recorded; alpha 0 where no lit frame shows it."""
    surface = wall_surface(wall, parameters.smoothing_mm, parameters.shading_mm, context.scratch)
    grid = flat_grid(surface, probe, parameters.oversampling, parameters.tile_mm)
    views = lit_views(recording, trajectory)
    reach = parameters.reach_radii * surface.mean_radius_mm
    ring = float(np.arctan2(surface.mean_radius_mm, probe.laser.baseline_mm))
    sampler = LightSampler(surface, probe, views, reach, parameters.laser_band_mm, parameters.left_out)
    gauge = NoiseGauge(
        recording, probe, grid, surface, views, sampler.reference, parameters.laser_band_mm,
        parameters.left_out,
    )  # fmt: skip
    plan = _plan(gauge, seen_by(grid, surface, views, probe.laser, reach), parameters.most_views, context)
    stretches = cut_plan(plan, parameters.views_at_once)
    images = _Images(recording, views, sum(len(s.wanted) for s in stretches), context)
    picture, lights = Blended.empty(grid, context.scratch), LightChain(len(views.frame), probe, ring)
    for stretch in stretches:
        lumas = images.read(stretch.wanted, read_luma)
        samples = joined(list(in_threads(sampler.of, lumas, context.workers)), stretch.wanted)
        light = lights.add(samples, stretch.wanted, sampler.reference)
        mosaic = Mosaic(
            grid, surface, probe, views, plan, stretch.tiles, light, parameters.laser_band_mm,
            parameters.left_out, picture,
        )  # fmt: skip
        mosaic.fill(images.read(stretch.wanted, read_split), context.workers)
    _report_light(lights, context)
    return _flat_picture(picture, grid, parameters.white_quantile, context)


def _plan(gauge: NoiseGauge, seen: list[TileViews], most: int, context: Context) -> list[TileViews]:
    """Return the views to blend into each tile: as many as the pictures' noise requires."""
    noise = gauge.noise(seen)
    if np.isfinite(noise):
        context.report("noise of lit pictures, from their differences", noise, "grey levels")
    asked = views_against(noise, most)
    return thinned(seen, most) if asked == most else shared(seen, asked)


class _Images:
    """The frames that some tile uses, read twice: for the light and for the picture."""

    def __init__(self, recording: Recording, views: LitViews, wanted: int, context: Context) -> None:
        self._recording, self._views, self._wanted, self._context = recording, views, wanted, context
        self._done = 0

    def read(self, wanted: Int, reader: _Reader[Read]) -> Iterator[tuple[int, Read | None]]:
        """Yield (view, image) in order; None where a frame cannot be decoded."""
        frames = self._views.frame[wanted]
        for view, (_, image) in zip(wanted, reader(self._recording, frames), strict=True):
            yield int(view), image
            self._done += 1
            self._context.progress(self._done, 2 * self._wanted)


def _report_light(lights: LightChain, context: Context) -> None:
    gain = lights.gain[lights.wanted]
    rejected = int(np.isnan(gain).sum())
    context.report("lit frames used for the texture", len(gain) - rejected, "frames")
    context.report("rejected: lit frames too dark, clipped or unreadable", rejected, "frames")
    context.report("photometric residual", lights.residual, "relative")
    if rejected < len(gain):
        context.report("spread of exposure between frames", float(np.nanstd(np.log(gain))), "relative")
    else:
        context.warn(
            "no lit frame shows the wall: the model has no texture. What to do: record with the LEDs on"
        )


def _flat_picture(picture: Blended, grid: FlatGrid, white_quantile: float, context: Context) -> WallTexture:
    """Return the picture in 8 bits: as bright as recorded at the laser ring, darker where that would clip."""
    parts = [slice(a, a + grid.tile_rows) for a in range(0, grid.rows, grid.tile_rows)]
    brightness, views = np.zeros(1 << 16, np.int64), np.zeros(1 << 8, np.int64)
    for part in parts:
        count = picture.count[part]
        blue, green, red = (picture.colour[part, :, c] for c in range(3))
        brightest = np.maximum(np.maximum(blue, green), red)
        brightness += np.bincount(brightest[count > 0], minlength=len(brightness))
        views += np.bincount(count.ravel(), minlength=len(views))
    white = brightest_wall(brightness, white_quantile)
    gain = np.float32(min(1 / REFLECTANCE_SCALE, _WHITE / white))
    context.report("brightness of the photo over the recorded frames", float(gain * REFLECTANCE_SCALE), "")
    bgra = context.scratch.zeros((grid.rows, grid.columns, 4), np.uint8)
    shown = np.minimum(np.arange(len(brightness), dtype=np.float32) * gain + 0.5, 255).astype(np.uint8)
    for part in parts:
        bgra[part, :, :3] = shown[picture.colour[part]]
        bgra[part, :, 3] = np.where(picture.count[part] > 0, 255, 0)
    context.report("wall textured", float(1 - views[0] / views.sum()), "fraction")
    context.report("views behind a pixel, median", quantile_of_counts(views, 0.5), "views")
    return WallTexture(bgra, grid.distance_from_mm, grid.mm_per_px, grid.azimuth_from_rad, grid.rad_per_px)


def brightest_wall(counts: Int, quantile: float) -> float:
    """Return the ``quantile`` of the wall's brightness without glints; 1 if no wall is seen.

    Parameters
    ----------
    counts
        Pixels (N,) of each brightness 0 to N - 1.
    quantile
        Share of the wall that is no brighter than the result.
    """
    if not counts.any():
        return 1.0
    matt = _MATT_RATIO * max(quantile_of_counts(counts, 0.5), 1.0)
    return min(quantile_of_counts(counts, quantile), matt)


def quantile_of_counts(counts: Int, quantile: float) -> float:
    """Return the quantile of whole numbers that occur ``counts`` (N,) times, linear between two of them."""
    place = quantile * (int(counts.sum()) - 1)
    ends = np.searchsorted(np.cumsum(counts), [np.floor(place), np.ceil(place)], side="right")
    return float(ends[0] + (place - np.floor(place)) * (ends[1] - ends[0]))


def _texture_of_run(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    trajectory: Trajectory,
    wall: Wall,
    parameters: TextureParameters,
    context: Context,
) -> WallTexture:
    """Photograph the wall from the frames that the pictures show to be lit.

    Poses and wall belong to the probe as corrected by the stage motion, so the pixels are projected with it.
    """
    found = probe.as_found_in(trajectory)
    return photograph_wall(frames.applied_to(recording), found, trajectory, wall, parameters, context)


TEXTURE = Stage(
    "texture",
    "13",
    TextureParameters,
    _texture_of_run,
    "lit frames to the wall's photo as a flat picture, evenly lit, as bright as recorded",
)
