"""Findings that are counted or read off the photometric state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import centred, chance_of, sigmas
from stages.twin.compare import CLIPPED_WALL
from stages.twin.gate import Suspected
from stages.twin.line_light import LineLight
from stages.twin.locate import FALSE_ALARM
from stages.twin.noise import CameraNoise
from stages.twin.picture import FEWEST_FRAMES, LEAST_BLUR_PX, OF_LAW, WholePictures
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring
from stages.twin.state import PhotometricState
from stages.twin.switched import IN_FOCUS_PX, defocus, response, wide_line

_CLIPPED = 0.05
"""Share of ring samples above which clipping is reported."""
_LEAST_POWER, _SURE_OF_POWER, _ALIKE = 0.06, 3.0, 0.3
"""Smallest reported departure of an exponent from 1 (a slightly blurred photo loses as much contrast), and
its significance in σ. Share of the departure by which fine and coarse texture may differ."""
_OF_BLOCKS = 0.005
"""1 σ of an exponent because the mean of powers over a block is not the power of its mean."""
_MAP_BLOCKS, _USUAL_GAIN, _USUAL_OFFSET, _MEDIAN_OF_SQUARE = 4, 0.02, 1.0, 0.455
"""Blocks per cell side in the map of gain and offset; usual gain and offset of a cell, as prior; median of
the square of a normal number."""


def clipped(rings: RingSamples, line_share: float, wall_share: float) -> tuple[Mismatch, ...]:
    """Return a clipped line and clipped lit wall; these are counted, not inferred, and χ² stays as it was.

    ``line_share`` is the share of pixels in the line's middle whose strongest channel is at full scale, and
    ``wall_share`` that of pixels of lit wall at the level where grey levels clip.
    """
    lost = float(np.mean(rings.validity == RingValidity.SATURATED)) if rings.validity.size else 0.0
    nan, found = float("nan"), []
    for share, least, what, where, of in (
        (lost, _CLIPPED, "The line is", "line", "of ring samples"),
        (line_share, _CLIPPED, "The line's colour is", "line", "of the pixels in its middle"),
        (wall_share, CLIPPED_WALL, "Lit wall is", "image", "of pixels of lit wall"),
    ):
        if share > least:
            found.append(Mismatch(
                "saturation", "line" if where == "line" else "intensity", where, (),
                (NamedFigure("share", share, 0.0, of),), 0.0, nan, nan,
                f"{what} clipped in {100 * share:.0f} % {of}.",
            ))  # fmt: skip
    return tuple(found)


def beside_clipping(
    named: Sequence[Mismatch],
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return what is named though lit wall clips, and the responses that are then withdrawn.

    The photo is made from the same frames: where they clip, it is as flat as with another response.
    """
    unsure = tuple(m for m in named if "response" in m.names)
    said = "{} But lit wall is clipped, and so is its photo, which looks the same: the cause cannot be told."
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in unsure)
    return tuple(m for m in named if m not in unsure), withdrawn


def response_of(samples: BlockSamples | None, ring: Ring) -> tuple[Suspected, ...]:
    """Return a response by which wall has another contrast than in its photo, from the blocks of lit frames.

    Blocks and means over sixteen blocks must agree: a displaced or blurred photo loses contrast in fine
    texture only.
    """
    if samples is None or samples.frame.max() + 1 < FEWEST_FRAMES:
        return ()
    (frame, each), (_, coarse) = (_exponents(samples, side) for side in (1, _MAP_BLOCKS))
    power, least = float(each.mean()), abs(float(coarse.mean()) - 1)
    chance, way = max(chance_of(e - 1) for e in (each, coarse)), np.sign(power - 1)
    sure = min(sigmas((e - 1) * way) for e in (each, coarse)) > _SURE_OF_POWER
    alike = abs(float(coarse.mean()) - power) < _ALIKE * abs(power - 1)
    if chance > FALSE_ALARM or least < _LEAST_POWER or not sure or not alike:
        return ()
    sd = float(np.hypot(each.std() / np.sqrt(len(each)), _OF_BLOCKS))
    nan = float("nan")
    found = Mismatch(
        "response", "intensity", "image", (), (NamedFigure("exponent", power, sd),), chance, nan, nan,
        f"Recorded wall has the contrast of its photo raised to the power {power:.2f}: the response differs "
        "from that of the photo.", ring.whole(int(samples.number[0])),
    )  # fmt: skip
    return (Suspected(found, response, samples.number[frame], each[:, None]),)


def focus_of(
    state: PhotometricState, whole: WholePictures, named: Sequence[Mismatch]
) -> tuple[Suspected, ...]:
    """Return a blur of lit frames, and of the line; ``named`` are confirmed laws of whole pictures.

    A lens out of focus makes both, and the photo may hide one of them. If contrast follows another power than
    the photo's, curvature says nothing about blur.
    """
    if any(m.name == "response" for m in named):
        return ()
    moved = sum(m.parameters[0].value for m in named if "motion_blur" in m.names)
    half_variance = whole.even_blur(state.sharpness) - moved**2 / 2
    return (*_defocus(whole, half_variance), *_not_sharp(state.line, whole))


def _defocus(whole: WholePictures, half_variance: Float) -> tuple[Suspected, ...]:
    """Return a blur beyond that of photo and motion, from half its variance (F,), px²."""
    few = len(half_variance) < FEWEST_FRAMES
    if few or not whole.loses_texture or half_variance.mean() < LEAST_BLUR_PX**2 / 2:
        return ()
    each, nan = np.sqrt(2 * np.maximum(half_variance, 0)), float("nan")
    blur = float(each.mean())
    sd = float(np.hypot(each.std() / np.sqrt(len(each)), OF_LAW * blur))
    found = Mismatch(
        "defocus", "intensity", "image", (), (NamedFigure("blur", blur, sd, "px"),), chance_of(half_variance),
        nan, nan, f"Lit frames are blurred by {blur:.1f} px (1 σ) beyond the wall's photo in all directions.",
        whole.scene.ring.whole(whole.frame["blur"][0]),
    )  # fmt: skip
    return (Suspected(found, defocus, whole.frames_of("blur"), half_variance[:, None]),)


def _not_sharp(line: LineLight | None, whole: WholePictures) -> tuple[Suspected, ...]:
    """Return a line that is wider than its sheet and a lens in focus would make it.

    Its width is compared with a fixed limit, because the run's photo is as blurred as its frames.
    """
    if line is None or line.blur_px.value - 3 * line.blur_px.sd < IN_FOCUS_PX:
        return ()
    blur, nan, frame = line.blur_px, float("nan"), whole.frames_of("line")
    found = Mismatch(
        "defocus or thick_sheet", "line", "line", (), (NamedFigure("blur", blur.value, blur.sd, "px"),),
        nan, nan, nan,
        f"The line is blurred by {blur.value:.1f} px (1 σ) beyond its sheet's stated thickness: the lens "
        "is out of focus, or the sheet is thicker than stated. In a pipe of one diameter both look alike.",
    )  # fmt: skip
    return (Suspected(found, wide_line, frame, np.full((len(frame), 1), blur.value)),)


def _exponents(samples: BlockSamples, side: int) -> tuple[Int, Float]:
    """Return frames (F,) and the exponents (F,) between their recorded and predicted brightness.

    Cells have ``side`` blocks a side. What stays at one place of the image is removed: light, vignetting and
    dirt are no response.
    """
    place = (samples.row // side) * 10_000 + samples.column // side
    cell, of, count = np.unique(place + samples.frame * 10_000_000, return_inverse=True, return_counts=True)
    whole = count >= side**2 / 2
    logs = (samples.log_level, samples.log_change + samples.log_level)
    frame, place = cell[whole] // 10_000_000, np.unique(cell[whole] % 10_000_000, return_inverse=True)[1]
    x, y = (centred((np.bincount(of, v) / count)[whole], place, frame) for v in logs)
    above, below = (np.bincount(frame, v, samples.frame.max() + 1) for v in (x * y, x * x))
    seen = np.flatnonzero(below > 0)
    return seen, np.asarray(above[seen] / below[seen])


def left_over(samples: BlockSamples | None) -> tuple[float, tuple[NamedFigure, ...]]:
    """Return by how much a map of gain and offset that stays in the image lowers χ², and its size.

    The map stands for whatever got no name. The map from every second frame is tested on the others; where
    they fit no better, there is none. A cell's gain and offset are shrunk to 0 by their usual size and the
    blocks' scatter.
    """
    if samples is None or samples.frame.max() + 1 < FEWEST_FRAMES:
        return 0.0, ()
    x, half = np.exp(samples.log_level), samples.frame % 2
    y, cell = samples.change * x, (samples.row // _MAP_BLOCKS) * 10_000 + samples.column // _MAP_BLOCKS
    cell = np.unique(cell, return_inverse=True)[1]
    spread = float(np.median(samples.weight * y**2)) / _MEDIAN_OF_SQUARE
    maps = [_gain_and_offset(x, y, samples.weight / spread * (half == h), cell) for h in (0, 1)]
    gain, offset = (np.where(half == 0, maps[1][k][cell], maps[0][k][cell]) for k in (0, 1))
    rest = y - gain * x - offset
    fall = np.asarray(np.bincount(samples.frame, samples.weight * (y**2 - rest**2)), float)
    if sigmas(fall) < _SURE_OF_POWER:
        return 0.0, ()
    figures = [
        NamedFigure(n, float(np.sqrt(np.mean(a * b))), float(np.std(a - b) / 2), u)
        for n, u, a, b in zip(
            ("unnamed_gain", "unnamed_offset"), ("relative", "grey levels"), *maps, strict=True
        )
        if (a * b).mean() > 0
    ]
    return float(fall.sum()), tuple(figures)


def _gain_and_offset(x: Float, y: Float, weight: Float, cell: Int) -> tuple[Float, Float]:
    """Return gain and offset of each cell that fit y (N,) to x (N,) best."""
    sums = (weight * x * x, weight * x, weight, weight * x * y, weight * y)
    xx, x1, one, xy, y1 = (np.asarray(np.bincount(cell, v), float) for v in sums)
    xx, one = xx + 1 / _USUAL_GAIN**2, one + 1 / _USUAL_OFFSET**2
    whole = xx * one - x1**2
    return (xy * one - y1 * x1) / whole, (y1 * xx - xy * x1) / whole


def noise_figures(noise: CameraNoise) -> tuple[NamedFigure, ...]:
    """Return the camera's noise in the terms of EMVA 1288."""
    e, read, levels = noise.electrons_per_level, noise.read_electrons, noise.read_levels
    return (
        NamedFigure("black_dn", noise.black.value, noise.black.sd, "grey levels"),
        NamedFigure("white_dn", noise.white, 0.0, "grey levels"),
        NamedFigure("read_dn", levels.value, levels.sd, "grey levels"),
        NamedFigure("read_e", read.value, read.sd, "electrons"),
        NamedFigure("gain_e_per_dn", e.value, e.sd, "electrons per grey level"),
        NamedFigure("non_uniformity", noise.uneven.value, noise.uneven.sd, "relative"),
        NamedFigure("gamma", noise.gamma.value, noise.gamma.sd, ""),
    )


def state_figures(state: PhotometricState) -> tuple[NamedFigure, ...]:
    """Return the main figures of lamps, laser and lens."""
    found: list[NamedFigure] = []
    if state.lamp is not None:
        place, gain = state.place_px, state.lamp.gain
        found += [
            NamedFigure("photo_place_px", float(np.median(place)), float(np.ptp(place)) / 2, "px"),
            NamedFigure("exposure_spread", gain.spread, float(np.median(gain.sd)), "relative"),
        ]
        names = ("lamp_cos_1", "lamp_sin_1", "lamp_cos_2", "lamp_sin_2")
        found += [
            NamedFigure(n, float(v), float(s), "relative")
            for n, v, s in zip(names, state.lamp.pattern, state.lamp.pattern_sd, strict=True)
        ]
    if state.line is not None:
        line = state.line
        colours = zip(("blue", "green", "red"), line.colour, line.colour_sd, strict=True)
        found += [NamedFigure(f"line_{n}", float(v), float(s), "share") for n, v, s in colours]
        found += [
            NamedFigure(
                "laser_power_spread", line.course.spread, float(np.median(line.course.sd)), "relative"
            ),
            NamedFigure("sheet_sigma_mm", line.sheet_mm.value, line.sheet_mm.sd, "mm"),
            NamedFigure("lens_blur_px", line.blur_px.value, line.blur_px.sd, "px"),
            NamedFigure("line_halo", line.halo.value, line.halo.sd, "share of light"),
            NamedFigure("line_skewness", line.skewness.value, line.skewness.sd, ""),
            NamedFigure("speckle", line.speckle.value, line.speckle.sd, "relative"),
        ]
    return tuple(found)
