"""Two recordings whose pictures or readings are late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.physics.catalogue import effect
from stages.diagnose.agreement import Agreement
from stages.diagnose.channels import Seen
from stages.diagnose.profile.evidence import ProfileEvidence
from stages.diagnose.profile.finding import Size, finding
from stages.diagnose.result import Diagnosis
from stages.diagnose.travel.evidence import TravelEstimate
from stages.diagnose.travel.model import TravelFit
from tests.diagnosed import AGREES, seen


def late(
    source: str, fit: TravelFit, delay_s: float | None, width_ms: tuple[float, float] | None,
    agreements: tuple[Agreement, ...] = (AGREES,), sigma_s: float = 2e-4,
) -> Seen:  # fmt: skip
    """Return a recording whose readings seem late, and whose line widens with the probe's speed."""
    estimates: tuple[TravelEstimate, ...] = ()
    if delay_s is not None:
        p = 1e-12 if abs(delay_s) > 5e-3 else 0.8
        estimates = (
            TravelEstimate("time_offset", "delay_s", delay_s, sigma_s, 1e-3, p, 0.01, (), (AGREES,)),
        )  # fmt: skip
    recording = seen(source, estimates=estimates, fit=fit)
    if width_ms is None:
        return recording
    value, sigma = width_ms
    size, z = Size("exposure_s", "s", 1e-3 * value, 1e-3 * sigma), value / sigma
    blur = finding("motion_blur", z, 1e-12 if z > 6 else 0.5, (size,), "It widens.")
    of_line = ProfileEvidence("toy", np.arange(9), (replace(blur, agreements=agreements),))
    return replace(recording, profile=of_line)


def sizes(found: Diagnosis) -> dict[str, float]:
    return {e.name: e.parameters[effect(e.name).quantities[0].name].value for e in found.effects}
