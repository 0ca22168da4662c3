"""What a recording says beforehand of a scene's pipe."""

from __future__ import annotations

from pipeline.recording.base import BoreSection, PipeFacts
from pipeline.recording.base import Fiducials as StatedFiducials
from pipeline.simulator.wall.description import Fiducials, Pipe
from pipeline.simulator.wall.fiducials import markers_of


def facts_of(pipe: Pipe) -> PipeFacts:
    """Return the section ``pipe`` of recording.yaml: the nominal bore, and of a gauge also its fiducials."""
    return PipeFacts(
        nominal_diameter_mm=pipe.nominal_diameter_mm or pipe.diameter_mm,
        bore=tuple(BoreSection(b.length_mm, b.diameter_mm) for b in pipe.bore),
        bore_tolerance_mm=pipe.bore_tolerance_mm if pipe.bore else 0.0,
        fiducials=None if pipe.fiducials is None else _stated(pipe.fiducials),
    )


def _stated(fiducials: Fiducials) -> StatedFiducials:
    return StatedFiducials(
        dictionary=fiducials.dictionary,
        size_mm=fiducials.size_mm,
        columns_along="+azimuth",
        rows_along="+distance",
        markers=markers_of(fiducials),
    )
