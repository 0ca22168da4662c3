"""All that one recording says."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.recording.base import Recording
from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.profile.evidence import ProfileEvidence
from stages.diagnose.travel.evidence import TravelEvidence


@dataclass(frozen=True)
class Seen:
    """All that one recording says; a channel that could not be examined is None, and the reason is told.

    Attributes
    ----------
    recording : Recording
    geometry : Examined or None
        Rings and fiducials of a gauge run.
    travel : TravelEvidence or None
    profile : ProfileEvidence or None
    shortcomings : tuple of str
    field : FieldEvidence or None
        Rings and texture of an inspection.
    """

    recording: Recording
    geometry: Examined | None
    travel: TravelEvidence | None
    profile: ProfileEvidence | None
    shortcomings: tuple[str, ...]
    field: FieldEvidence | None = None
