"""Late pictures look like late encoder readings, unless the line's width distinguishes them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from stages.diagnose.agreement import TELLING, same
from stages.diagnose.channels import Seen
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.profile.finding import Finding, Size
from stages.diagnose.result import Value
from stages.diagnose.travel.events import is_found
from stages.diagnose.travel.evidence import TravelEstimate, TravelEvidence
from stages.diagnose.travel.model import TravelFit, second_predictions
from stages.diagnose.travel.solve import DELAY

_EXPOSURE, _DELAY = "motion_blur", "time_offset"
# A width is not due to the exposure if it exceeds what a frame has time for by this many σ: by chance once in
# 700.
_SURE = 3.0
# Time stamps may refer to the start of an exposure, its middle, or any time between, all equally likely:
# pictures are late by between nothing and half of the exposure. Relative to a full half, this is 1 σ.
_BY_STAMPS = float(1 / np.sqrt(3))


@dataclass(frozen=True)
class Exposure:
    """What is known about the exposure time of a probe.

    Pictures exposed longer than stated from the same start are late by half of the excess, and blur the line
    by all of it.

    Attributes
    ----------
    widths : tuple of Finding
        The exposure according to the line's width, in each recording of the probe.
    """

    stated_s: float
    widths: tuple[Finding, ...] = ()

    @classmethod
    def of(cls, stated_s: float, recordings: Iterable[Seen | None]) -> Exposure:
        """Return the exposure according to the line's width in some recordings, in their order."""
        profiles = [s.profile for s in recordings if s is not None and s.profile is not None]
        widths = (f for p in profiles for f in p.findings if f.effect == _EXPOSURE and f.sizes)
        return cls(stated_s, tuple(widths))

    def leaves_open(self, found: TravelEstimate) -> bool:
        """Return whether a width without confirmation may account for an uncertain part of this delay."""
        shown = next((f for f in self.widths if f.found), None)
        if found.effect != _DELAY or shown is None:
            return False
        return not (shown.agreements and all(a.confirmation.agrees for a in shown.agreements))

    def taken_off(self, seen: Seen | None) -> Seen | None:
        """Return a recording's evidence with the encoder's own delay, if the width shows an exposure."""
        longer = next((f.sizes[0] for f in self.widths if f.found), None)
        if seen is None or seen.travel is None or longer is None:
            return seen
        fit = seen.travel.fit
        if not self._has_time(fit, longer):
            return seen
        # Nothing is subtracted for an encoder without delay: stamps may refer to the exposure's middle.
        each = (
            _less_half(e, longer, fit) if e.effect == _DELAY and is_found(e.p_value) else e
            for e in seen.travel.estimates
        )
        return replace(seen, travel=replace(seen.travel, estimates=tuple(each)))

    def _has_time(self, fit: TravelFit | None, longer: Size) -> bool:
        """Return whether pictures can be exposed for so much longer: each ends before the next begins."""
        if fit is None:
            return True
        return longer.value - _SURE * longer.sigma < fit.sight.frame_time_s - self.stated_s

    def too_long(self, seen: Seen, found: Finding) -> str:
        """Return a sentence on an exposure that no picture has time for; empty for any other finding."""
        fit = seen.travel.fit if seen.travel is not None else None
        if found.effect != _EXPOSURE or not found.sizes or fit is None or self._has_time(fit, found.sizes[0]):
            return ""
        apart = f"{1e3 * fit.sight.frame_time_s:.1f} ms"
        return f", for which no picture has time: the next begins after {apart}."

    def alike(self, found: TravelEstimate, travel: TravelEvidence) -> tuple[str, ...]:
        """Return ``motion_blur`` where a longer exposure may be the reason why readings seem late.

        The exposure must end before the next picture begins. What the width shows was subtracted before.
        """
        if found.effect != _DELAY or travel.fit is None or any(f.found for f in self.widths):
            return ()
        exposure = Size("exposure_s", "s", 2 * found.value, 2 * found.size_sigma)
        possible = exposure.value > 0 and self._has_time(travel.fit, exposure)
        told_apart = any(_another(exposure, f.sizes[0]) for f in self.widths)
        return (_EXPOSURE,) if possible and not told_apart else ()


def how_late(
    size: dict[str, Value], recordings: Sequence[Seen | None], own_delay: bool
) -> tuple[dict[str, Value], str]:
    """Return an effect's size, for an exposure with the delay of its pictures, and a sentence to add.

    Stamps may refer to the exposure's middle, so that half of it need not delay a picture relative to its
    stamp. Of two recordings, the first that can distinguish half of the exposure from zero is used; where
    none can, the delay is unknown. Any further delay of the encoder may or may not be due to the exposure: it
    is included in σ. With ``own_delay`` the encoder has a certain delay of its own, from which half of the
    exposure was subtracted.
    """
    if "exposure_s" not in size:
        return size, ""
    exposure = size["exposure_s"]
    half = Value(exposure.value / 2, exposure.sd / 2)
    if own_delay:
        return size | {"late_s": Value(half.value, float(np.hypot(half.sd, half.value * _BY_STAMPS)))}, ""
    shown = _shown(exposure, recordings)
    if shown is None:
        return size, ""
    if not is_found(shown.p_value):
        return size | {"late_s": Value(0.0, shown.size_sigma)}, ""
    value, beyond = min(max(shown.value, 0.0), half.value), shown.value - half.value
    late = Value(value, max(shown.size_sigma, half.sd * (value == half.value), beyond))
    sigma = float(np.hypot(shown.size_sigma, half.sd))
    if beyond <= _SURE * sigma:
        return size | {"late_s": late}, ""
    by = f"{1e3 * beyond:.1f} ms (± {1e3 * sigma:.1f})"
    return size | {"late_s": late}, f" The encoder is later than the exposure accounts for, by {by}."


def _shown(exposure: Value, recordings: Iterable[Seen | None]) -> TravelEstimate | None:
    """Return the first encoder's delay that distinguishes half of an exposure from zero, else the best."""
    travels = (s.travel for s in recordings if s is not None and s.travel is not None)
    each = [e for t in travels if (e := t.estimate(_DELAY)) is not None and np.isfinite(e.size_sigma)]
    telling = (e for e in each if is_found(e.p_value) or _SURE * e.size_sigma < exposure.value / 2)
    return next(telling, min(each, key=lambda e: e.size_sigma, default=None))


def whole_size(late: TravelEstimate) -> Value:
    """Return a size before anything was subtracted, to compare recordings of one probe.

    The reference of time stamps is common to them and explains no difference.
    """
    return Value(late.value + late.taken_off, late.size_sigma)


def own_size(late: TravelEstimate) -> Value:
    """Return a size with a σ that includes the uncertain reference of time stamps in what was subtracted."""
    return Value(late.value, float(np.hypot(late.size_sigma, late.taken_off * _BY_STAMPS)))


def _less_half(late: TravelEstimate, longer: Size, fit: TravelFit | None) -> TravelEstimate:
    """Return the delay minus half of a longer exposure, and what parts of the travel say of the rest.

    A delay between zero and that half does not need a late encoder, whatever stamps refer to.
    """
    half = longer.value / 2
    value, sigma = late.value - half, float(np.hypot(late.sigma, longer.sigma / 2))
    again = late.agreements if fit is None else second_predictions(fit, DELAY, known=half)
    own = replace(late, value=value, sigma=sigma, agreements=again, taken_off=half)
    if not np.isfinite(sigma):
        return own
    possible = LIBRARY[_DELAY].possible((), np.array([value]))
    beyond = max(value, -late.value, 0.0) / own.size_sigma
    return replace(own, p_value=float(2 * norm.sf(beyond)) if possible else 1.0)


def _another(exposure: Size, width: Size) -> bool:
    """Return whether the line's width determines the exposure, and determines another one."""
    size = max(exposure.value, abs(width.value))
    gap = np.array([[exposure.sigma**2 + width.sigma**2]])
    agree = same(np.array([exposure.value]), np.array([width.value]), gap, size)
    return width.sigma < TELLING * size and not agree
