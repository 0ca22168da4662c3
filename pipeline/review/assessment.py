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
ASSUMPTIONS = (
    "the pipe data given, sound steel that fails by plastic flow, internal pressure alone, a defect by itself"
    "; the criteria's own scatter against burst tests is not included"
)


@dataclass(frozen=True)
class Strength:
    """Estimated failure pressure, MPa, by both criteria, and what it rests on.

    It is stated without ±: the σ of the depth would give a few kPa, while burst tests scatter about both
    criteria by far more, and that scatter is not known for the pipe at hand.
    """

    b31g_mpa: float
    modified_mpa: float
    assumptions: str = ASSUMPTIONS


def strength(
    depth_mm: float, length_mm: float, bore_mm: float, wall_mm: float, yield_mpa: float
) -> Strength | None:
    """Return the failure pressure of metal loss; None where the criteria do not apply."""
    if not 0 < depth_mm <= LARGEST_LOSS * wall_mm:
        return None
    outer = bore_mm + 2 * wall_mm
    loss, z, barlow = depth_mm / wall_mm, length_mm**2 / (outer * wall_mm), 2 * wall_mm / outer
    return Strength(
        b31g(loss, z) * 1.1 * yield_mpa * barlow,
        modified_b31g(loss, z) * (yield_mpa + _FLOW_ABOVE_YIELD_MPA) * barlow,
    )


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
