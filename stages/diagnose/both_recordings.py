"""Two recordings of one probe: whether they agree on shared sizes, and how improbable both are by chance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.channels import Seen
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


def global_p(field: Seen | None, gauge: Seen | None) -> float:
    """Return the smallest p-value of all channels, times the number of channels that show anything.

    The p-values of the line's profile leave out errors of image formation, so that only those count which
    exceed these, too.
    """
    each = []
    for seen in (field, gauge):
        if seen is None:
            continue
        if seen.geometry is not None:
            each.append(seen.geometry.global_p)
        if seen.travel is not None:
            each.append(seen.travel.least_p)
        if seen.profile is not None:
            each.append(min((f.p_value for f in seen.profile.findings if f.found), default=1.0))
    showing = [p for p in each if p < 1]
    return float(min(min(showing) * len(showing), 1.0)) if showing else 1.0
