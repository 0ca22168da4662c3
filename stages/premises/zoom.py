"""Finds pictures from which on all is enlarged or reduced: a digital zoom, another crop, another scaling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float, Int
from pipeline.machine.stage import Context
from stages.premises.light import Light
from stages.premises.losses import Steps
from stages.premises.pictures import CLOSED, Pictures

# If all radii of the picture grow by a share g, a wall seen at the polar angle θ seems to come nearer by
# g θ / sin² θ pipe radii: 1.39 g to 1.57 g from 45° to 80°, where the laser line lies.
_RADII_PER_SHARE = 1.45
# The wall's additional step fits the line's growth within this part of it: half-way to none, as where a bore
# steps, and to growth of the wall alone, as where pictures are lost.
_FITS = 0.5
# The usual steps must scatter by so much less (robust σ) than this part, or the step of a probe that is
# pulled by hand fits where a bore steps: as for losses of which there is other evidence.
_SIGMAS_BESIDE = 3.5
# The line grows alike if so many rays grow by at least half of the growth of all (chosen); lines are known
# to a pixel only. Smaller growth is within that, and `image_scale` finds it from texture and rings.
_ALIKE, _LEAST_SHARE = 0.8, 0.005
# A growth stands out if it is so many times the usual one from line to line, as for losses.
_SIGMAS = 6.0
_FEWEST_LINES = 12


@dataclass(frozen=True)
class Zoom:
    """From picture ``place`` on, lengths in the picture are longer by the share ``growth`` than before."""

    place: int
    growth: float


def zooms(pictures: Pictures, light: Int, steps: Steps) -> list[Zoom]:
    """Return where the laser line and the lit wall grow together, by the same share.

    Parameters
    ----------
    light : (F,)
        `Light` of each picture.
    steps
        Motion of the lit wall, in pipe radii.
    """
    line = np.flatnonzero((light == Light.LINE) & (pictures.closed > CLOSED))
    if len(line) < _FEWEST_LINES or not len(steps.end):
        return []
    growth, stands_out = _growth(np.diff(np.log(pictures.line_px[line]), axis=0))
    found = []
    for k in np.flatnonzero(stands_out):
        place = _wall_grows_too(steps, int(line[k]), int(line[k + 1]), float(growth[k]))
        found += [] if place is None else [Zoom(place, float(growth[k]))]
    return found


def _growth(share: Float) -> tuple[Float, Bool]:
    """Return the growth (L,) of lines from that on their rays (L, R), and whether it stands out."""
    quarter = share.shape[1] // 4
    growth = np.asarray(np.sort(share, axis=1)[:, quarter : share.shape[1] - quarter].mean(1))
    alike = np.mean(share * np.sign(growth)[:, None] > np.abs(growth)[:, None] / 2, axis=1) > _ALIKE
    usual = float(np.median(np.abs(growth)))
    return growth, alike & (np.abs(growth) > max(_SIGMAS * usual, _LEAST_SHARE))


def _wall_grows_too(steps: Steps, first: int, last: int, growth: float) -> int | None:
    """Return the picture of the wall that ends a step which fits the line's growth between two pictures."""
    over = np.flatnonzero((steps.start < last) & (steps.end > first))
    if not over.size or over.size == len(steps.end):
        return None
    others, more = np.delete(steps.size, over), _RADII_PER_SHARE * growth
    off = np.abs(steps.size[over] - np.median(others) - more)
    within = _FITS * abs(more)
    fits = off.min() < within and _SIGMAS_BESIDE * spread_about_median(others) < within
    return int(steps.end[over[off.argmin()]]) if fits else None


def without_zooms(steps: Steps, pictures: Pictures, light: Int) -> tuple[Steps, list[Zoom]]:
    """Return the steps of the wall that are no `zooms`, and the zooms."""
    found = zooms(pictures, light, steps)
    return steps.of(~np.isin(steps.end, [zoom.place for zoom in found])), found


def warn_of_zooms(found: Sequence[Zoom], frame: Int, context: Context) -> None:
    """Warn from which of the frames (F,) on the picture has another scale."""
    for zoom in found:
        context.warn(
            f"from about frame {frame[zoom.place]} on, the picture is "
            f"{'enlarged' if zoom.growth > 0 else 'reduced'} by {100 * abs(np.expm1(zoom.growth)):.1f} %: "
            "laser line and wall change alike, as neither lost pictures nor another bore alone do. Zoom, "
            "stabilisation or another crop was switched on or off, or the recording was scaled. The probe "
            "file can be right on one side only: pipe, laser or encoder may seem to jump, and radii and "
            "distances on the other side are wrong by more than their σ. What to do: process the two parts "
            "as separate recordings, each with a probe that was calibrated at this scale"
        )
