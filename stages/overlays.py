"""The stage overlays colours the wall by deviation, by uncertainty (1 σ) and by the error of a misalignment.

Colour maps are safe for colour-blind readers and even in lightness: a blue-white-red map of ColorBrewer for
signed values, `cividis` (Nuñez, Anderton, Renslow 2018) for values that only grow.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pipeline.adjustment.robust import basis_of, robust_spread
from pipeline.arrays import Byte, Float
from pipeline.artefacts.measured import RadiusMap, Wall
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Recording

# Colour of what was not measured: middle grey, which no colour map has.
_NOT_MEASURED_BGR = (128, 128, 128)
# A sound pipe has two harmonics beside its mean radius: it lies off centre, and it is oval.
_HARMONICS = 2
# 95 % efficiency for normal errors (P. Huber, "Robust statistics", 1981).
_HUBER = 1.345
# Rows and cells worked on at a time, for memory's sake.
_ROWS, _AT_ONCE = 4096, 1 << 24


class OverlayParameters(Parameters):
    """How error colours are chosen."""

    shown_quantile: float = Field(
        0.995, ge=0.5, le=1, description="share of the measured wall that the colour range holds"
    )
    smallest_range_mm: float = Field(
        0.02, gt=0, le=10, description="mm; smaller ranges are widened to this, so that noise is not blown up"
    )
    signed_colours: Literal["RdBu_r", "PuOr_r", "BrBG"] = Field(
        "RdBu_r", description="colour map of signed values; zero is white"
    )
    growing_colours: Literal["cividis", "viridis"] = Field(
        "cividis", description="colour map of values that start at zero"
    )


def draw_overlays(
    recording: Recording, wall: Wall, parameters: OverlayParameters, context: Context
) -> Overlays:
    """Return the error colours of ``wall``.

    Raises
    ------
    UnusableError
        When the radius map holds no measured cell.
    """
    if not np.isfinite(wall.radius_map.radius_mm).any():
        raise UnusableError("overlays", "no cell of the wall was measured", hint="see the earlier warnings")
    overlays = overlays_of(wall.radius_map, recording.pipe.nominal_diameter_mm, parameters)
    for overlay in overlays.pictures:
        context.report(f"overlay {overlay.name}: range", overlay.high_mm, "mm")
        context.report(f"overlay {overlay.name}: beyond the range", 100 * overlay.beyond, "%")
    return overlays


def overlays_of(radius_map: RadiusMap, nominal_diameter_mm: float, parameters: OverlayParameters) -> Overlays:
    """Return the error colours of a radius map that holds measured cells."""
    radius, fitted = radius_map.radius_mm, fitted_pipe(radius_map).astype(np.float32)
    nominal = np.float32(nominal_diameter_mm / 2)
    signed, growing = parameters.signed_colours, parameters.growing_colours
    misaligned = radius_map.misalignment_mm
    return Overlays(
        radius_map.distance_mm,
        radius_map.azimuth_rad,
        fitted.astype(float),
        nominal_diameter_mm / 2,
        _signed("deviation", "Deviation from the fitted pipe", radius - fitted, signed, parameters),
        _signed("deviation_nominal", "Deviation from the nominal pipe", radius - nominal, signed, parameters),
        _growing("uncertainty", "Uncertainty of the radius (1 σ)", radius_map.sigma_mm, growing, parameters),
        _signed("misalignment", "Radius error if misalignment were ignored", misaligned, signed, parameters),
    )


def fitted_pipe(radius_map: RadiusMap) -> Float:
    """Return the radius (A,), mm, of the best off-centre oval over the whole run.

    The median along the pipe at each azimuth, smoothed to its mean, first (centre) and second (oval)
    harmonics with Huber weights: neither defects nor gaps move it.
    """
    seen = np.isfinite(radius_map.radius_mm).any(axis=0)
    columns = np.array_split(np.flatnonzero(seen), max(radius_map.radius_mm.size // _AT_ONCE, 1))
    medians = [np.nanmedian(radius_map.radius_mm[:, c].astype(float), axis=0) for c in columns if len(c)]
    profile = np.concatenate(medians)
    basis = basis_of(radius_map.azimuth_rad, _HARMONICS)
    weight = np.ones(len(profile))
    for _ in range(20):
        root = np.sqrt(weight)
        coefficients = np.linalg.lstsq(basis[seen] * root[:, None], profile * root, rcond=None)[0]
        size = np.abs(profile - basis[seen] @ coefficients)
        scale = max(robust_spread(size), 1e-9)
        weight = np.minimum(1, _HUBER * scale / np.maximum(size, 1e-12))
    return np.asarray(basis @ coefficients)


def _signed(
    name: str, title: str, value_mm: NDArray[np.floating], colours: str, parameters: OverlayParameters
) -> Overlay:
    """Return the overlay of a signed quantity, its range symmetric about zero."""
    high = _range(np.abs(value_mm), parameters)
    return _overlay(name, title, value_mm, -high, high, colours)


def _growing(
    name: str, title: str, value_mm: NDArray[np.floating], colours: str, parameters: OverlayParameters
) -> Overlay:
    """Return the overlay of a quantity that starts at zero."""
    return _overlay(name, title, value_mm, 0.0, _range(value_mm, parameters), colours)


def _range(size_mm: NDArray[np.floating], parameters: OverlayParameters) -> float:
    """Return the upper end of the colours, mm: the share ``shown_quantile`` lies below it, two digits."""
    some = size_mm[:: max(size_mm.size // _AT_ONCE, 1)]
    measured = some[np.isfinite(some)]
    size = float(np.quantile(measured, parameters.shown_quantile)) if len(measured) else 0.0
    size = max(size, parameters.smallest_range_mm)
    unit = 10.0 ** (np.floor(np.log10(size)) - 1)
    return float(f"{np.ceil(size / unit - 1e-9) * unit:.6g}")


def _overlay(
    name: str, title: str, value_mm: NDArray[np.floating], low: float, high: float, colours: str
) -> Overlay:
    level = np.zeros(value_mm.shape, np.uint8)
    outside, known = 0, 0
    for start in range(0, len(value_mm), _ROWS):
        value = value_mm[start : start + _ROWS].astype(float)
        measured = np.isfinite(value)
        scaled = np.where(measured, (value - low) / (high - low), 0.0)
        level[start : start + _ROWS] = np.where(measured, 1 + np.rint(np.clip(scaled, 0, 1) * 254), 0)
        outside += int(np.count_nonzero(measured & ((scaled < 0) | (scaled > 1))))
        known += int(np.count_nonzero(measured))
    return Overlay(name, title, colours, low, high, outside / max(1, known), _palette(colours), level)


def _palette(colours: str) -> Byte:
    # matplotlib is slow to import, so it is imported only when it is needed.
    from matplotlib import colormaps

    rgb = colormaps[colours](np.linspace(0, 1, 255))[:, :3]
    bgr = np.rint(255 * rgb[:, ::-1]).astype(np.uint8)
    return np.vstack([np.array([_NOT_MEASURED_BGR], np.uint8), bgr])


OVERLAYS = Stage(
    "overlays",
    "3",
    OverlayParameters,
    draw_overlays,
    "wall -> deviation, uncertainty, misalignment as colours",
)
