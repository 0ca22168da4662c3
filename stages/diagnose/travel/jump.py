"""A slip as the encoder's reading alone shows it: a jump against its own smooth motion."""

from __future__ import annotations

import numpy as np

from pipeline.recording.base import Encoder
from stages.diagnose.agreement import Agreement, Part, agreement

# Duration of a slip, and number of readings around it that its speed is taken from. Debt: data/debts.md.
SLIPS_WITHIN_S = 0.03
_AROUND = 8
_TAIL = 2.275


def jump_of_reading(encoder: Encoder, at: int, lasting_mm: float, sigma_mm: float) -> Agreement | None:
    """Return whether the reading jumps by what it keeps on gaining on the pictures; None when it cannot tell.

    Parameters
    ----------
    at
        Reading after which it would jump.
    lasting_mm, sigma_mm
        By how much the reading is ahead of the pictures after the moment, and 1 σ.
    """
    jump, sigma = reading_jump(encoder, at)
    if not np.isfinite(sigma):
        return None
    lasting = Part(
        "what the reading has gained on the pictures ever since",
        f"{lasting_mm:+.3f} mm (± {sigma_mm:.2g} mm)", np.array([lasting_mm]),
    )  # fmt: skip
    alone = Part(
        "jump of the reading against its own motion", f"{jump:+.3f} mm (± {sigma:.2g} mm)", np.array([jump])
    )
    own = np.array([[sigma_mm**2]]), np.array([[sigma**2]])
    return agreement(lasting, alone, own, own[0] + own[1])


def reading_jump(encoder: Encoder, at: int) -> tuple[float, float]:
    """Return what the reading gains around a moment beyond its own speed before and after, mm, and 1 σ.

    1 σ is a quarter of the range that holds the same sum at 95.4 % of all other moments, turns and bursts
    included. NaN too close to the ends.
    """
    step = np.diff(encoder.distance_mm)
    rate = float(np.median(np.diff(encoder.time_s)))
    width = 2 * max(int(np.ceil(SLIPS_WITHIN_S / rate / 2)), 1) - 1
    side = width // 2
    reach = side + _AROUND
    if not reach <= at < len(step) - reach:
        return float("nan"), float("nan")
    weight = np.full(2 * reach + 1, -width / (2 * _AROUND))
    weight[_AROUND : _AROUND + width] = 1.0
    gained = np.correlate(step, weight, mode="valid")
    here = at - reach
    others = np.delete(gained, slice(max(here - 2 * reach, 0), here + 2 * reach + 1))
    if len(others) < 4 * reach:
        return float("nan"), float("nan")
    low, high = np.percentile(others, [_TAIL, 100 - _TAIL])
    return float(gained[here]), float(high - low) / 4
