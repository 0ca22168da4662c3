"""Test whether two recordings of one probe agree on the sizes that they share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.result import Value

# Another recording has its own events and aliases, and its frame P has another roll.
_OF_ONE_RECORDING = frozenset({"time_s", "duration_s", "slip_mm", "frequency_hz", "direction_deg"})


def agreements(
    where: str, sizes: Mapping[str, Value], elsewhere: str, others: Mapping[str, Value], of: str = ""
) -> Iterable[Agreement]:
    """Return whether two recordings agree on each quantity that they share; ``of`` names its owner."""
    for name, value in sizes.items():
        if name not in others or name in _OF_ONE_RECORDING:
            continue
        first, second = _part(where, name, value, of), _part(elsewhere, name, others[name], of)
        found = agreement(first[0], second[0], (first[1], second[1]), first[1] + second[1])
        if found is not None:
            yield found


def _part(where: str, name: str, value: Value, of: str) -> tuple[Part, Float]:
    """Return a quantity with its covariance; an azimuth is given as a unit vector."""
    words = f"{of}{name} {value.value:.4g} (± {value.sd:.2g})"
    if not name.endswith("azimuth_deg"):
        return Part(where, words, np.array([value.value])), np.array([[value.sd**2]])
    angle = np.radians(value.value)
    return Part(where, words, np.array([np.cos(angle), np.sin(angle)])), np.radians(value.sd) ** 2 * np.eye(2)
