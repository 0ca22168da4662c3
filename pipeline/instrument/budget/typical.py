"""A probe as it leaves the workshop, for budgets without a probe file."""

from __future__ import annotations

import numpy as np

from pipeline.instrument.camera.kannala_brandt import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe


def typical_probe(baseline_mm: float = 22.0) -> Probe:
    """Return an uncalibrated probe: equidistant 360 px/rad, σ as "typical" in the shared PHYSICS notes.

    Its σ: focal length 10⁻³, principal point 0.5 px, k1 10⁻³, tilt 0.05° per axis, opening angle 0.1°,
    baseline 0.05 mm.
    """
    camera = KannalaBrandt((1600, 1200), (360.0, 360.0), (799.5, 599.5))
    laser = LaserSheet(baseline_mm)
    names = (*camera.parameter_names, *LaserSheet.PARAMETER_NAMES)
    sigma = {"cx": 0.5, "cy": 0.5, "k1": 1e-3, "tilt_x": np.radians(0.05), "tilt_y": np.radians(0.05),
             "cone_rad": np.radians(0.05), "baseline_mm": 0.05}  # fmt: skip
    covariance = np.diag([sigma.get(n, 0.0) ** 2 for n in names])
    covariance[:2, :2] = 0.36**2
    return Probe(camera, laser, covariance)
