"""Parameters of the search for defects."""

from __future__ import annotations

from pydantic import Field

from pipeline.machine.stage import Parameters


class DefectParameters(Parameters):
    """Parameters of the search for defects."""

    min_depth_mm: float = Field(
        0.2, ge=0.01, le=10.0, description="smallest depth or height worth reporting, mm"
    )
    min_size_mm: float = Field(
        5.0, ge=1.0, le=50.0, description="diameter from which defects shall be found by rings alone, mm"
    )
    false_alarms: float = Field(
        0.05, ge=1e-6, le=1.0, description="expected number of false detections by noise in a recording"
    )
    smooth_mm: float = Field(
        60.0, ge=20.0, le=2000.0, description="length over which the pipe's own shape may vary, mm"
    )
    max_weld_mm: float = Field(
        30.0, ge=2.0, le=200.0, description="longest all-round bead along the pipe, mm"
    )
    outline_fraction: float = Field(
        0.2, ge=0.05, le=0.8, description="outline at this fraction of the depth, dimensionless"
    )
    join_mm: float = Field(
        4.0, ge=0.0, le=50.0, description="defects of one sign with a smaller gap are one defect, mm"
    )
    draws: int = Field(
        200, ge=20, le=5000, description="noise draws for the depth's bias and sigma, dimensionless"
    )
