"""Frames -> ring samples: sub-pixel radius, σ, width, amplitude and validity at every azimuth."""

from __future__ import annotations

from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from stages.rings.extract import RingParameters, extract_rings

__all__ = ["RINGS", "RingParameters", "extract_rings"]


def _rings_of_run(
    recording: Recording, frames: CheckedFrames, probe: Probe, parameters: RingParameters, context: Context
) -> RingSamples:
    """Extract the rings of the frames that the pictures show to be lit by the laser."""
    return extract_rings(frames.applied_to(recording), probe, parameters, context)


RINGS = Stage(
    "rings", "32", RingParameters, _rings_of_run, "laser frames to sub-pixel ring samples with their σ"
)
