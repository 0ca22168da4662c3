"""Camera, laser sheet and poses from a run through a gauge of known bore."""

from pipeline.machine.stage import Stage
from stages.calibrate.gauge.calibrate import calibrate_gauge
from stages.calibrate.gauge.parameters import GaugeParameters
from stages.calibrate.gauge.premises import require_gauge
from stages.calibrate.gauge.result import GaugeCalibration

__all__ = ["GAUGE", "GaugeCalibration", "GaugeParameters", "calibrate_gauge", "require_gauge"]

GAUGE = Stage(
    "gauge", "1", GaugeParameters, calibrate_gauge, "fiducials and rings on known bore to camera and sheet"
)
