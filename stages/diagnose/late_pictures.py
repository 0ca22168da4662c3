"""Pictures that are late: readings that come late show the same, unless the line's width tells them apart."""

from __future__ import annotations

import numpy as np

from stages.diagnose.agreement import TELLING, same
from stages.diagnose.profile.evidence import ProfileEvidence
from stages.diagnose.profile.finding import Size
from stages.diagnose.travel.evidence import TravelEstimate, TravelEvidence

_EXPOSURE, _DELAY = "motion_blur", "time_offset"


def exposure_alike(
    found: TravelEstimate, travel: TravelEvidence, profile: ProfileEvidence | None
) -> tuple[str, ...]:
    """Return ``motion_blur`` where an exposure may be what makes an encoder's readings seem late.

    Pictures exposed longer from the same start are late by half of that. The exposure ends before the next
    picture begins, and blurs the line by as much as it is long.
    """
    if found.effect != _DELAY or travel.fit is None:
        return ()
    exposure = Size("exposure_s", "s", 2 * found.value, 2 * found.size_sigma)
    longest = travel.fit.sight.frame_time_s + exposure.sigma
    fits = 0 < exposure.value < longest and not _told_apart(exposure, profile)
    return (_EXPOSURE,) if fits else ()


def _told_apart(exposure: Size, profile: ProfileEvidence | None) -> bool:
    """Return whether the line's width tells of another exposure."""
    findings = profile.findings if profile is not None else ()
    widths = [size for f in findings if f.effect == _EXPOSURE for size in f.sizes]
    return any(_another(exposure, width) for width in widths)


def _another(exposure: Size, width: Size) -> bool:
    telling = width.sigma < TELLING * exposure.value
    gap = np.array([[exposure.sigma**2 + width.sigma**2]])
    return telling and not same(np.array([exposure.value]), np.array([width.value]), gap, exposure.value)
