"""A difference between motion and encoder that no reported effect explains: size, time and significance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from pipeline.arrays import Float, Int
from stages.diagnose.travel.events import SLIP, chance, is_found
from stages.diagnose.travel.model import EventKind, TravelFit
from stages.diagnose.travel.noise import AT_ONCE, DriftNoise, Whitened, chance_of_noise
from stages.diagnose.travel.sight import PLACED_SIGMA_MM
from stages.diagnose.travel.solve import DELAY, FAR_BETTER, OFFSET, PLAY, SMOOTH
from stages.diagnose.travel.steps import StepFound, or_else

# The residual of the readings is noise unless its p-value is below this. Debt: data/debts.md.
_NOISE = 1e-6
# A stretch with less information than this share of the largest is not used.
_DETERMINED = 1e-9
# Neighbouring pictures have a common offset if neither is off by more than this factor times the other
# (chosen).
_ALIKE = 2
# Parameters of a stretch: start, end and size.
_OWN = 3


@dataclass(frozen=True)
class LeftOver:
    """By how much the reading is off beyond all that was reported, in the stretch where it shows most.

    The reading at the first picture is taken to be right: after a slip the reading is off, not before it.

    Attributes
    ----------
    off_mm : float
        Reading − visual distance, mean over the stretch.
    where : tuple of int
        First and last index of the `Sight` between which it is off.
    time_s : tuple of float
        Their times.
    p_value : float
        Of a difference as large by chance, over all stretches that were tested.
    stray : int
        Number of consecutive pictures that were treated as stray: all of the stretch, or all others; 0 where
        some of them were not.
    by_slip : bool
        Whether one slip would also explain it.
    """

    off_mm: float
    where: tuple[int, int]
    time_s: tuple[float, float]
    p_value: float
    stray: int
    by_slip: bool

    @property
    def statement(self) -> str:
        """Return it as a sentence."""
        first, last = self.time_s
        off = f"Between {first:.2f} and {last:.2f} s the reading is off by {self.off_mm:+.2f} mm"
        if self.by_slip and not self.stray:
            return f"{off}, as after a slip of the wheel: record the passage again, slowly."
        if self.by_slip:
            return or_else(f"{off}: the wheel slipped", f"{self.stray} pictures in a row were misplaced")
        unless = f", unless {self.stray} pictures in a row were misplaced" if self.stray else ""
        return f"{off} in a way that no effect of an encoder explains{unless}."


@dataclass(frozen=True)
class Stretch:
    """Pictures from ``first`` up to, but not including, ``end`` that are off by ``size_mm``.

    ``gain`` is the fall of χ²; ``left`` is the remaining χ², with ``free`` degrees of freedom.
    """

    first: int
    end: int
    size_mm: float
    gain: float
    left: float
    free: int

    @property
    def misfit(self) -> float:
        """The remaining χ² per degree of freedom."""
        return self.left / self.free


def left_over(fit: TravelFit, steps: Sequence[StepFound], count_mm: float) -> LeftOver | None:
    """Return what is left beside smooth effects, steps and single stray pictures; None where it may be noise.

    Neighbouring pictures with a common offset are not stray: the part that the fit removes for them is still
    to be explained. Smooth effects are estimated again beside it, so that they absorb none of it.

    Parameters
    ----------
    steps
        Of the fit, in its order.
    count_mm
        Unit of the readings.
    """
    noise = _of_places(fit, count_mm) if fit.sight.placed else fit.noise
    unreported = _unreported(fit, steps)
    off = _beside(fit, unreported, noise)
    count = len(fit.sight.time_s)
    p_value = _p_of(fit, off, noise)
    if p_value >= _NOISE:
        return None
    off = _simplest(fit, unreported, noise, off)
    # Beside a delay and a play that it does not need, a stretch may come out far larger than alone.
    p_value = max(p_value, _p_of(fit, off, noise))
    if p_value >= _NOISE:
        return None
    time_s = fit.sight.time_s
    is_noise = chance_of_noise(off.misfit, count, count) > _NOISE
    between_s = float(time_s[off.first]), float(time_s[off.end - 1])
    by_slip = is_noise and SLIP not in fit.without and off.end == count
    stray = _stray_pictures(fit, unreported, off)
    return LeftOver(off.size_mm, (off.first, off.end - 1), between_s, p_value, stray, by_slip)


def _stray_pictures(fit: TravelFit, unreported: list[int], off: Stretch) -> int:
    """Return how many pictures, all of a stretch or all others, were treated as stray; else 0."""
    events = (fit.events[k - len(SMOOTH)] for k in unreported)
    taken = {e.place for e in events if e.kind is EventKind.OUTLIER}
    within = set(range(off.first, off.end))
    rows = (within, set(range(len(fit.sight.time_s))) - within)
    return next((len(row) for row in rows if row and row <= taken), 0)


def _of_places(fit: TravelFit, count_mm: float) -> DriftNoise:
    """Return the noise of pictures whose places fiducials determine independently: it does not accumulate."""
    return DriftNoise(float(np.sqrt(PLACED_SIGMA_MM**2 + fit.noise.white_mm**2 + count_mm**2)), 0.0)


def _simplest(fit: TravelFit, unreported: list[int], noise: DriftNoise, beside: Stretch) -> Stretch:
    """Return the stretch found ``beside`` delay and play, or beside neither where that is simpler.

    A temporary offset may have been taken for a delay or a play.
    """
    lags = [k for k in (DELAY, PLAY) if fit.values[k] != 0]
    if not lags:
        return beside
    alone = _beside(fit, [*lags, *unreported], noise)
    return alone if alone.left - beside.left < FAR_BETTER * len(lags) else beside


def _beside(fit: TravelFit, unreported: list[int], noise: DriftNoise) -> Stretch:
    """Return the strongest stretch beside all that was found, except the ``unreported`` columns."""
    held = [k for k in range(len(SMOOTH)) if k != OFFSET and fit.values[k] == 0]
    return strongest_stretch(fit.with_columns(np.delete(fit.columns, [*held, *unreported], axis=1), noise))


def strongest_stretch(rest: Whitened) -> Stretch:
    """Return the stretch of constant offset that explains most of the residual, among all after a picture.

    The effect of a stretch from a to b is the difference of sums up to b and up to a, and so is its
    information.
    """
    up_to = np.pad(np.cumsum(rest.weighted), (1, 0))
    places = np.arange(len(up_to))
    ends = np.array_split(places, len(places) // AT_ONCE + 1)
    own = np.concatenate([_shared(rest, e)[e, np.arange(len(e))] for e in ends])
    gain, first, end, size = 0.0, 1, 1, 0.0
    for e in ends:
        information = own[:, None] + own[e] - 2 * _shared(rest, e)
        tried = (places[:, None] > 0) & (places[:, None] < e) & (information > _DETERMINED * own.max())
        found = np.where(tried, up_to[e] - up_to[:, None], 0.0) / np.where(tried, information, 1.0)
        each = found**2 * information
        at, here = np.unravel_index(np.argmax(each), each.shape)
        if each[at, here] > gain:
            gain, first, end, size = float(each[at, here]), int(at), int(e[here]), float(found[at, here])
    left = max(float(rest.residual @ rest.weighted) - gain, 0.0)
    free = max(len(rest.residual) - len(rest.estimate) - _OWN, 1)
    return Stretch(first, end, size, gain, left, free)


def _shared(rest: Whitened, ends: Int) -> Float:
    """Return the information (N + 1, E) that sums up to each picture share with sums up to ``ends``."""
    before = np.arange(len(rest.residual))[:, None] < ends
    return np.pad(np.cumsum(rest.beyond(before.astype(float)), axis=0), ((1, 0), (0, 0)))


def _p_of(fit: TravelFit, off: Stretch, noise: DriftNoise) -> float:
    """Return the p-value of a stretch, for independent places by fiducials or for a random walk."""
    return _p_of_places(fit, off, noise) if fit.sight.placed else _p_of_way(fit, off)


def _p_of_places(fit: TravelFit, off: Stretch, noise: DriftNoise) -> float:
    """Return the p-value of a stretch by errors of fiducials, which neighbouring pictures share.

    The size is uncertain by at least one picture's error, and by more where other effects look alike.
    """
    z = min(abs(off.size_mm) / noise.white_mm, np.sqrt(off.gain))
    return min(1.0, _tries(fit) * float(2 * norm.sf(z)))


def _p_of_way(fit: TravelFit, off: Stretch) -> float:
    """Return the p-value of a stretch, or of the whole residual, by a random walk: the smaller of both."""
    one = chance(off.gain / max(off.misfit, 1.0), _tries(fit), len(fit.sight.time_s))
    return min(1.0, 2 * min(one, fit.fits_p))


def _tries(fit: TravelFit) -> int:
    count = len(fit.sight.time_s)
    return count * (count - 1) // 2


def _unreported(fit: TravelFit, steps: Sequence[StepFound]) -> list[int]:
    """Return the indices of values for consecutive stray pictures, or for steps that chance may make."""
    found, out = iter(steps), []
    stray = {e.place: fit.values[4 + k] for k, e in enumerate(fit.events) if e.kind is EventKind.OUTLIER}
    for k, event in enumerate(fit.events):
        if event.kind is EventKind.OUTLIER:
            beside = (stray.get(event.place + way, 0.0) for way in (-1, 1))
            own = stray[event.place]
            is_told = not any(other * own > max(other**2, own**2) / _ALIKE for other in beside)
        else:
            is_told = is_found(next(found).p_value)
        if not is_told:
            out.append(4 + k)
    return out
