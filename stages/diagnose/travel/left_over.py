"""What is between motion and encoder and no effect that was told explains: how much, and when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from pipeline.arrays import Float
from stages.diagnose.travel.events import chance
from stages.diagnose.travel.model import EventKind, TravelFit
from stages.diagnose.travel.steps import StepFound

# Below this chance, motion against encoder shows an effect: of 300 recordings without any, with three smooth
# effects each, a hundredth of one would.
TRAVEL_FOUND = 1e-5
# 1 σ of a picture's place by fiducials, which may be put there wrongly. Debt: data/debts.md.
PLACED_SIGMA_MM = 0.05
# What is left of the reading is noise unless its chance is below this. Debt: data/debts.md.
_NOISE = 1e-6


@dataclass(frozen=True)
class LeftOver:
    """By how much the reading is off beyond all that was told.

    Attributes
    ----------
    off_mm : float
        Where it is most.
    where : tuple of int
        Places of the `Sight`, both included, between which it is off by at least half as much.
    time_s : tuple of float
        Their times.
    """

    off_mm: float
    where: tuple[int, int]
    time_s: tuple[float, float]

    @property
    def statement(self) -> str:
        """Return it in a plain sentence."""
        first, last = self.time_s
        return (
            f"Between {first:.2f} and {last:.2f} s the reading is off by up to {self.off_mm:.2f} mm in a way "
            "that no effect of an encoder explains."
        )


def left_over(fit: TravelFit, steps: Sequence[StepFound], count_mm: float) -> LeftOver | None:
    """Return what is left beside smooth effects and sure slips; None where it may be noise.

    Steps that may be something else are not told as slips, and neighbouring pictures that are off alike are
    no stray ones: what the fit takes out for them is still to be explained.

    Parameters
    ----------
    steps
        Of the fit, in its order.
    count_mm
        Unit of the readings.
    """
    untold = _untold(fit, steps)
    off = fit.whitened.residual + fit.columns[:, untold] @ fit.values[untold]
    off = np.abs(off - np.median(off))
    if not (_off_from_places(fit, off, count_mm) if fit.sight.placed else _off_from_way(fit, untold)):
        return None
    far = np.flatnonzero(off >= off.max() / 2)
    first, last = int(far[0]), int(far[-1])
    time_s = float(fit.sight.time_s[first]), float(fit.sight.time_s[last])
    return LeftOver(float(off.max()), (first, last), time_s)


def _off_from_places(fit: TravelFit, off_mm: Float, count_mm: float) -> bool:
    """Return whether (N,) is more than errors of fiducials, which place every picture by itself."""
    sigma = float(np.sqrt(PLACED_SIGMA_MM**2 + fit.noise.white_mm**2 + count_mm**2))
    return float(2 * norm.sf(off_mm.max() / sigma)) * len(off_mm) < _NOISE


def _off_from_way(fit: TravelFit, untold: list[int]) -> bool:
    """Return whether there is more than what a way gathers from picture to picture, a random walk."""
    count = len(fit.sight.time_s)
    each = (fit.event_z2[k - 4] for k in untold)
    return fit.fits_p < _NOISE or any(chance(z2, 2 * count, count) < TRAVEL_FOUND for z2 in each)


def _untold(fit: TravelFit, steps: Sequence[StepFound]) -> list[int]:
    """Return the places among the fit's values of events that nothing told explains."""
    found, out = iter(steps), []
    stray = {e.place: fit.values[4 + k] for k, e in enumerate(fit.events) if e.kind is EventKind.OUTLIER}
    for k, event in enumerate(fit.events):
        if event.kind is EventKind.OUTLIER:
            beside = (stray.get(event.place + way, 0.0) for way in (-1, 1))
            is_told = not any(other * stray[event.place] > 0 for other in beside)
        else:
            step = next(found)
            is_told = not step.rivals and step.p_value < TRAVEL_FOUND
        if not is_told:
            out.append(4 + k)
    return out
