"""Camera, laser sheet and poses from a run through a gauge of known bore."""

from __future__ import annotations

from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checked_frames import CheckedFrames
from stages.calibrate.gauge.calibrate import calibrate_gauge
from stages.calibrate.gauge.premises import require_gauge
from stages.calibrate.gauge.result import GaugeCalibration
from stages.calibrate.gauge.state import GaugeParameters

__all__ = ["GAUGE", "GaugeCalibration", "GaugeParameters", "calibrate_gauge", "require_gauge"]


def _calibrate_run(
    recording: Recording,
    frames: CheckedFrames,
    rings: RingSamples,
    probe: Probe,
    parameters: GaugeParameters,
    context: Context,
) -> GaugeCalibration:
    """Calibrate with frames and encoder as the pictures bear them out: see `calibrate_gauge`."""
    return calibrate_gauge(frames.applied_to(recording), rings, probe, parameters, context)


GAUGE = Stage(
    "gauge", "2", GaugeParameters, _calibrate_run, "fiducials and rings on known bore to camera and sheet"
)
