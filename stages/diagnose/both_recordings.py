"""Test whether two recordings of one probe agree on the sizes that they share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

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
        found = agreement(_part(where, name, value, of), _part(elsewhere, name, others[name], of))
        if found is not None:
            yield found


def _part(where: str, name: str, value: Value, of: str) -> Part:
    """Return a quantity as measured in a recording; an azimuth is given as a unit vector."""
    words = f"{of}{name} {value.value:.4g} (± {value.sd:.2g})"
    if not name.endswith("azimuth_deg"):
        return Part.of(where, words, value.value, value.sd)
    angle = np.radians(value.value)
    return Part(where, words, np.array([np.cos(angle), np.sin(angle)]), np.radians(value.sd) ** 2 * np.eye(2))
