"""Remaining strength of thinned pipe: ASME B31G and modified B31G (0.85 dL).

B31G: J. F. Kiefner, P. H. Vieth, "A modified criterion for evaluating the remaining strength of corroded
pipe", PRCI PR-3-805, 1989; ASME B31G-2012, § 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_FLOW_ABOVE_YIELD_MPA = 69.0
# Beyond this share of the wall neither criterion applies.
LARGEST_LOSS = 0.8


@dataclass(frozen=True)
class Strength:
    """Failure pressure, MPa, by both criteria, with the 1 σ that the depth's σ causes."""

    b31g_mpa: float
    b31g_sigma_mpa: float
    modified_mpa: float
    modified_sigma_mpa: float


def strength(
    depth_mm: float, depth_sigma_mm: float, length_mm: float, bore_mm: float, wall_mm: float, yield_mpa: float
) -> Strength | None:
    """Return the failure pressure of metal loss; None where the criteria do not apply."""
    if not 0 < depth_mm <= LARGEST_LOSS * wall_mm:
        return None
    outer = bore_mm + 2 * wall_mm

    def both(depth: float) -> tuple[float, float]:
        loss = min(max(depth, 0.0) / wall_mm, 1.0)
        z = length_mm**2 / (outer * wall_mm)
        barlow = 2 * wall_mm / outer
        return b31g(loss, z) * 1.1 * yield_mpa * barlow, modified_b31g(loss, z) * (
            yield_mpa + _FLOW_ABOVE_YIELD_MPA
        ) * barlow

    here, deeper = both(depth_mm), both(depth_mm + depth_sigma_mm)
    return Strength(here[0], abs(here[0] - deeper[0]), here[1], abs(here[1] - deeper[1]))


def b31g(loss: float, z: float) -> float:
    """Return failure over flow stress for relative depth ``loss`` and z = L²/(D t)."""
    if z > 20:
        return 1 - loss
    bulging = np.sqrt(1 + 0.8 * z)
    return float((1 - 2 / 3 * loss) / (1 - 2 / 3 * loss / bulging))


def modified_b31g(loss: float, z: float) -> float:
    """Return failure over flow stress by the modified criterion."""
    bulging = np.sqrt(1 + 0.6275 * z - 0.003375 * z**2) if z <= 50 else 0.032 * z + 3.3
    return float((1 - 0.85 * loss) / (1 - 0.85 * loss / bulging))
