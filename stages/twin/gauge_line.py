"""The laser line of a gauge run re-rendered with an instrument, to see whether a diagnosis makes it fit.

In an inspection an instrument's error hides: wall and poses are measured with the very instrument. In a gauge
run nothing is left for it to hide in: the bore is stated, fiducials alone place the camera, and the rings
have no say. The line's light (its brightness in each block of 1.5° and its profile) is taken as it is
recorded; where the line lies is predicted by the simulator. What is compared are pixels about the line,
as far from steps of the bore and from fiducials as the calibration keeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field
from threadpoolctl import threadpool_limits

from pipeline.arrays import Bool, Float, Image, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.artefacts.twin import GaugeTwin
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context, Of, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checked_frames import CheckedFrames
from pipeline.simulator.effects.switch import Switch, parse_switches
from pipeline.simulator.exact import room_mm
from pipeline.simulator.truth import SceneTruth
from stages.calibrate.gauge.calibrate import MeasuredRun
from stages.calibrate.gauge.state import GaugeParameters
from stages.diagnose.channels import GaugeMeasured
from stages.twin.noise import black_and_white
from stages.twin.placement import scene_with

RING_BINS = 240
"""Blocks around the ring: those into which the calibration condenses it (`GaugeParameters.ring_bins`)."""
_HALF_PX = 12.0
"""Half width of the compared band about the recorded line. It holds the line where it is predicted, too, for
errors that matter; a line predicted outside the band leaves the recorded one wholly unexplained."""
_PROFILE_WIDTHS, _CELLS, _CLASSES, _ROUNDS = 6.0, 73, 4, 3
_NEAR = 2
"""Frames are compared that have fiducials so near in time: farther off a pose is a guess."""
_SOLVE, _SLOPE_PX, _FARTHEST_PX, _SETTLED_PX = 5, 0.5, 6.0, 0.02
_FEWEST_FRAMES = 4
_LEAST_VARIANCE = 1.0 / 12
"""Of rounding to whole grey levels."""
_SURE = 3.0
"""σ, from frame to frame, of a difference of χ² from which on one instrument fits better than another."""
_PROBED_PX, _TOLD = 0.2, 0.1
"""The power is stated as the displacement that raises χ² by a tenth, found from one of 0.2 px."""


class GaugeLineParameters(GaugeParameters):
    """Parameters of the gauge run's twin."""

    effects: tuple[str, ...] = Field((), description="effects that are switched on, as simulate takes them")
    frames: int = Field(40, ge=4, le=400, description="most laser frames that are compared")


@dataclass(frozen=True)
class LineBlocks:
    """Pixels about the recorded line in the compared frames, in the blocks of azimuth of the calibration.

    Attributes
    ----------
    frame : (F,) int
        Places in the recording.
    of_frame, azimuth_rad, measured_px, width_px : (B,)
        Of each block: place of its frame in ``frame``, image azimuth, radius at which the ring was measured,
        and the line's width in that frame.
    block : (N,) int
        Of each pixel.
    offset_px, grey : (N,)
        Of each pixel: how far beyond the measured ring it lies, and its grey level.
    centre_px : (2,)
    white : float
        Grey level at which pixels clip; infinite where none do.
    """

    frame: Int
    of_frame: Int
    azimuth_rad: Float
    measured_px: Float
    width_px: Float
    block: Int
    offset_px: Float
    grey: Float
    centre_px: Float
    white: float

    @property
    def clipped(self) -> Bool:
        """(N,) pixels that say only that they are bright."""
        return self.grey >= self.white

    def total(self, values: Float) -> Float:
        """Return sums (B,) of the pixels' values (N,) over each block."""
        return np.asarray(np.bincount(self.block, values, len(self.of_frame)), float)


@dataclass(frozen=True)
class BlockLight:
    """Profile (C,) of the line over its width at ``x`` (C,), and the variance (N,) of each pixel about it."""

    x: Float
    profile: Float
    variance: Float


def compare_gauge_line(
    recording: Annotated[Recording, Of("gauge")],
    frames: Annotated[CheckedFrames, Of("gauge")],
    rings: Annotated[RingSamples, Of("gauge")],
    fiducials: Annotated[GaugeMeasured, Of("gauge")],
    *,
    parameters: GaugeLineParameters,
    context: Context,
) -> GaugeTwin:
    """Re-render the line of a gauge run with the stated instrument and with effects switched on.

    Raises
    ------
    InputError
        When an effect is not known or does not fit the scene.
    UnusableError
        When fiducials or rings are too few.
    """
    if fiducials.run is None:
        raise UnusableError("gauge_line", fiducials.problem, hint="record the gauge run again")
    line = gauge_line_of(frames.applied_to(recording), rings, fiducials.run, parameters)
    switches = parse_switches(parameters.effects)
    less = [tuple(s for s in switches if s is not left) for left in switches] if len(switches) > 1 else []
    place = []
    for done, chosen in enumerate(((), switches, *less)):
        context.progress(done, 2 + len(less))
        place.append(line.displacement_px(chosen))
    found = _judged(line, switches, place)
    context.report("chi-square per pixel of the gauge's line, as stated", found.chi2_stated, "")
    context.report("the same with what was diagnosed", found.chi2_diagnosed, "")
    return found


@dataclass(frozen=True)
class GaugeLine:
    """The line of a gauge run, to be held against instruments: see `gauge_line_of`.

    Attributes
    ----------
    recording : Recording
    run : MeasuredRun
    parameters : GaugeLineParameters
    blocks : LineBlocks
    light : BlockLight
    """

    recording: Recording
    run: MeasuredRun
    parameters: GaugeLineParameters
    blocks: LineBlocks
    light: BlockLight

    def displacement_px(self, effects: Sequence[Switch]) -> Float:
        """Return how far (B,) beyond the measured ring the stated instrument with effects has the line."""
        with threadpool_limits(1):
            scene = scene_with(self.recording, self.run, effects, self.parameters)
            return _displacement_px(scene, self.blocks)

    def chi2(self, displacement_px: Float) -> Float:
        """Return χ² per pixel (F,) of the frames for a line so displaced (B,)."""
        each = _square(self.blocks, self.light, displacement_px) / self.light.variance
        return np.bincount(self.blocks.of_frame[self.blocks.block], each) / self.pixels

    @property
    def pixels(self) -> Int:
        """(F,) pixels compared in each frame."""
        return np.bincount(self.blocks.of_frame[self.blocks.block])


def gauge_line_of(
    recording: Recording, rings: RingSamples, run: MeasuredRun, parameters: GaugeLineParameters
) -> GaugeLine:
    """Read the laser frames of a gauge run whose fiducials and rings are measured.

    Raises
    ------
    UnusableError
        When too few laser frames lie near frames with fiducials.
    """
    blocks = _blocks(recording, rings, run, parameters.frames)
    return GaugeLine(recording, run, parameters, blocks, light_of(blocks))


def _blocks(recording: Recording, rings: RingSamples, run: MeasuredRun, most: int) -> LineBlocks:
    """Return the pixels about the rings' bins on plain bore, in frames that fiducials place."""
    on_bore = run.measured.rings
    near = np.unique(on_bore.frame)
    near = near[np.abs(near[:, None] - run.posed).min(1) <= _NEAR]
    chosen = near[np.unique(np.linspace(0, len(near) - 1, min(most, len(near))).astype(int))]
    numbers = recording.frames.frame[chosen]
    images = [
        (p, i) for p, (_, i) in zip(chosen, recording.read(numbers, "grey"), strict=True) if i is not None
    ]
    if len(images) < _FEWEST_FRAMES:
        raise UnusableError(
            "gauge_line", f"{len(images)} laser frames lie near frames with fiducials",
            limit=f"at least {_FEWEST_FRAMES}", hint="record the gauge run with lit frames throughout",
        )  # fmt: skip
    place = np.array([p for p, _ in images])
    here = [np.flatnonzero(on_bore.frame == p) for p in place]
    kept = np.concatenate(here)
    away = on_bore.uv[kept] - rings.centre_px
    radius, azimuth = np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])
    first = np.cumsum([0, *map(len, here)])
    parts = [
        _pixels(image, rings.centre_px, azimuth[a:b], radius[a:b], a)
        for (_, image), a, b in zip(images, first[:-1], first[1:], strict=True)
    ]
    block, offset, grey = (np.concatenate([p[k] for p in parts]) for k in range(3))
    of_frame = np.repeat(np.arange(len(place)), np.diff(first))
    width = np.array([_width(rings, int(n)) for n in recording.frames.frame[place]])
    white = black_and_white([image.astype(np.float32) for _, image in images])[1]
    return LineBlocks(
        place, of_frame, azimuth, radius, width[of_frame], block, offset, grey, rings.centre_px, white
    )


def _pixels(
    image: Image, centre_px: Float, azimuth_rad: Float, radius_px: Float, first: int
) -> tuple[Int, Float, Float]:
    """Return block, offset from the ring and grey level of the pixels about a frame's blocks (B,)."""
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    du, dv = u - centre_px[0], v - centre_px[1]
    rho = np.hypot(du, dv)
    near = np.flatnonzero((rho > radius_px.min() - _HALF_PX) & (rho < radius_px.max() + _HALF_PX))
    phi, rho = np.arctan2(dv.ravel()[near], du.ravel()[near]), rho.ravel()[near]
    order = np.argsort(azimuth_rad)
    ring = np.interp(phi, azimuth_rad[order], radius_px[order], period=2 * np.pi)
    cell = np.full(RING_BINS, -1)
    cell[_cell_of(azimuth_rad)] = np.arange(len(azimuth_rad))
    block = cell[_cell_of(phi)]
    keep = (block >= 0) & (np.abs(rho - ring) < _HALF_PX)
    return first + block[keep], (rho - ring)[keep], image.ravel()[near[keep]].astype(float)


def _cell_of(azimuth_rad: Float) -> Int:
    return np.asarray(((azimuth_rad + np.pi) / (2 * np.pi) * RING_BINS).astype(int) % RING_BINS)


def _width(rings: RingSamples, frame: int) -> float:
    row = int(np.flatnonzero(rings.frame == frame)[0])
    return float(np.nanmedian(rings.width_px[row][rings.valid[row]]))


def _displacement_px(scene: SceneTruth, blocks: LineBlocks) -> Float:
    """Return how far (B,) beyond the measured ring a scene has the line; NaN where it has none near it."""
    out = np.full(len(blocks.of_frame), np.nan)
    for k, frame in enumerate(blocks.frame):
        here = blocks.of_frame == k
        azimuth, ring = blocks.azimuth_rad[here], blocks.measured_px[here]
        outward = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
        moved, step = np.zeros(len(ring)), np.zeros(len(ring))
        for _ in range(_SOLVE):
            uv = blocks.centre_px + (ring + moved)[:, None] * outward
            room, beyond = (room_mm(scene, int(frame), uv + d * outward) for d in (0.0, _SLOPE_PX))
            step = np.clip(_SLOPE_PX * room / (room - beyond), -_FARTHEST_PX, _FARTHEST_PX)
            moved = moved + step
        out[here] = np.where(np.abs(step) < _SETTLED_PX, moved, np.nan)
    return out


def light_of(blocks: LineBlocks) -> BlockLight:
    """Return the profile and the spread of the pixels where the line was measured.

    The spread is that of pixels alike in place across the line and in the line's brightness: noise, speckle,
    reflectance that changes within a block, and the codec.
    """
    x = np.linspace(-_PROFILE_WIDTHS, _PROFILE_WIDTHS, _CELLS)
    across = blocks.offset_px / blocks.width_px[blocks.block]
    cell = np.clip(np.round((across - x[0]) / (x[1] - x[0])).astype(int), 0, _CELLS - 1)
    light = BlockLight(x, np.exp(-0.5 * x**2), np.ones(len(across)))
    nowhere = np.zeros(len(blocks.of_frame))
    for _ in range(_ROUNDS):
        ground, height = _brightness(blocks, light, nowhere)
        above = blocks.grey - ground[blocks.block]
        use, peak = ~blocks.clipped, height[blocks.block]
        total, weight = (np.bincount(cell[use], v[use], _CELLS) for v in (above * peak, peak**2))
        profile = np.where(weight > 0, total / np.maximum(weight, 1e-9), light.profile)
        light = BlockLight(x, profile / profile.max(), light.variance)
    bright = np.searchsorted(np.quantile(height, np.linspace(0, 1, _CLASSES + 1)[1:-1]), height)
    kind = bright[blocks.block] * _CELLS + cell
    size, free = (_CLASSES, _CELLS), ~blocks.clipped
    count = np.bincount(kind[free], minlength=_CLASSES * _CELLS).reshape(size)
    for _ in range(_ROUNDS):  # the brightness of a block depends on the weights of its pixels
        total = np.bincount(kind[free], _square(blocks, light, nowhere)[free], _CLASSES * _CELLS).reshape(
            size
        )
        mean = total / np.maximum(count, 1)
        # Where all pixels clip they show no noise: it is at least that of the brightest that do not.
        mean = np.maximum(np.where(count > 0, mean, mean.max(1, keepdims=True)), _LEAST_VARIANCE)
        light = replace(light, variance=mean.ravel()[kind])
    return light


def _shape(blocks: LineBlocks, light: BlockLight, displacement_px: Float) -> Float:
    """Return the profile (N,) at pixels of lines displaced (B,); 0 where a block has no line."""
    across = (blocks.offset_px - displacement_px[blocks.block]) / blocks.width_px[blocks.block]
    return np.interp(np.nan_to_num(across, nan=np.inf), light.x, light.profile, left=0.0, right=0.0)


def _brightness(blocks: LineBlocks, light: BlockLight, displacement_px: Float) -> tuple[Float, Float]:
    """Return background and height (B,) of the line that suit each block best; no line is negative."""
    shape, weight = _shape(blocks, light, displacement_px), np.where(blocks.clipped, 0.0, 1 / light.variance)
    w, wp, wpp = (blocks.total(weight * shape**k) for k in range(3))
    wg, wpg = (blocks.total(weight * shape**k * blocks.grey) for k in range(2))
    spread = wpp * w - wp**2
    height = np.where(spread > 1e-9 * w**2, (wpg * w - wp * wg) / np.maximum(spread, 1e-12), 0.0)
    height = np.maximum(height, 0.0)
    return (wg - height * wp) / np.maximum(w, 1e-12), height


def _square(blocks: LineBlocks, light: BlockLight, displacement_px: Float) -> Float:
    """Return the squares (N,) of recorded less re-rendered grey levels."""
    ground, height = _brightness(blocks, light, displacement_px)
    level = ground[blocks.block] + height[blocks.block] * _shape(blocks, light, displacement_px)
    return (blocks.grey - np.minimum(level, blocks.white)) ** 2


def _judged(line: GaugeLine, switches: Sequence[Switch], place: Sequence[Float]) -> GaugeTwin:
    """Return χ² for places of the line: as stated, with all effects, and with all but one each."""
    blocks, pixels = line.blocks, line.pixels
    stated, diagnosed, *less = (line.chi2(p) for p in place)
    nowhere = np.zeros(len(blocks.of_frame))
    measured = line.chi2(nowhere)
    rise = line.chi2(nowhere + _PROBED_PX) - measured
    kept = [_is_better(left, diagnosed) for left in less] or [_is_better(stated, diagnosed)] * len(switches)
    return GaugeTwin(
        line.recording.frames.frame[blocks.frame], tuple(s.text for s in switches), int(pixels.sum()),
        _mean(stated, pixels), _mean(diagnosed, pixels), _mean(measured, pixels),
        _rms(place[0]), _rms(place[1]),
        float(_PROBED_PX * np.sqrt(_TOLD * _mean(measured, pixels) / max(_mean(rise, pixels), 1e-9))),
        sigmas(stated, diagnosed), tuple(kept),
    )  # fmt: skip


def _mean(chi2: Float, pixels: Int) -> float:
    return float((chi2 * pixels).sum() / pixels.sum())


def _rms(displacement_px: Float) -> float:
    return float(np.sqrt(np.nanmean(displacement_px**2)))


def sigmas(before: Float, after: Float) -> float:
    """Return by how many σ, taken from frame to frame, the χ² (F,) falls."""
    fall = before - after
    sd = float(np.std(fall, ddof=1)) / np.sqrt(len(fall))
    return float(fall.mean() / sd) if sd > 0 else 0.0


def _is_better(before: Float, after: Float) -> bool:
    return sigmas(before, after) > _SURE


GAUGE_LINE = Stage(
    "gauge_line",
    "1",
    GaugeLineParameters,
    compare_gauge_line,
    "the line of a gauge run beside the same line, re-rendered with what was diagnosed",
)
