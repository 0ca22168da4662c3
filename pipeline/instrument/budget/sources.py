"""The error sources: the paper's Table I, the further effects of the shared PHYSICS notes, a typical probe.

A systematic source moves parameters of the probe or of `Disturbance`; it is the same in every frame. A random
source moves every sample of the line on its own, and is averaged away over frames.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe

_DEG = math.radians(1)


class Kind(StrEnum):
    """Whether a source is the same in all frames."""

    SYSTEMATIC = "systematic"
    RANDOM = "random"


@dataclass(frozen=True)
class Source:
    """An error source.

    Attributes
    ----------
    name
        As in the shared PHYSICS notes.
    label
        In words.
    kind
    unit
        Of the σ shown.
    typical
        1 σ where the probe does not state it, in ``unit``; 0 where the effect needs a part (a window, a
        drifting temperature) that not every probe has.
    parameters
        What it moves; empty for random sources.
    factor
        Parameter units per ``unit``.
    table_one
        The row's name in the paper's Table I, else empty.
    """

    name: str
    label: str
    kind: Kind
    unit: str
    typical: float
    parameters: tuple[str, ...] = ()
    factor: float = 1.0
    table_one: str = ""


def stated_sources(probe: Probe) -> tuple[Source, ...]:
    """Return the sources whose σ the probe's covariance holds; all of them are systematic."""
    names = probe.camera.parameter_names
    focal = tuple(n for n in names if n.startswith("f"))
    centre = tuple(n for n in names if n in ("cx", "cy"))
    rest = tuple(n for n in names if n not in (*focal, *centre))
    first = rest[0] if rest else ""
    both = (
        Source("focal_scale", "Focal length", Kind.SYSTEMATIC, "px", 0.36, focal, 1.0, "focal length"),
        Source("principal_point", "Principal point, per axis", Kind.SYSTEMATIC, "px", 0.5, centre, 1.0,
               "camera calibration"),
        Source("radial_distortion", "Lens distortion", Kind.SYSTEMATIC, first, 1e-3, rest, 1.0,
               "camera calibration"),
        Source("laser_tilt", "Misalignment of the sheet, per axis", Kind.SYSTEMATIC, "°", 0.05,
               ("tilt_x", "tilt_y"), _DEG, "misalignment"),
        Source("laser_cone", "Opening angle", Kind.SYSTEMATIC, "°", 0.1, ("cone_rad",), _DEG / 2,
               "opening angle"),
        Source("baseline", "Baseline", Kind.SYSTEMATIC, "mm", 0.05, ("baseline_mm",), 1.0, "baseline"),
        Source("beam_decentre", "Laser beside the axis, per axis", Kind.SYSTEMATIC, "mm", 0.02,
               ("decentre_x_mm", "decentre_y_mm")),
        Source("sheet_waviness", "Waviness of the sheet, each of 6", Kind.SYSTEMATIC, "mrad", 0.02,
               LaserSheet.PARAMETER_NAMES[6:], 1e-3),
    )  # fmt: skip
    return tuple(source for source in both if source.parameters)


def further_sources(probe: Probe) -> tuple[Source, ...]:
    """Return the sources beyond the probe's covariance, independent of it and of each other."""
    focal = tuple(n for n in probe.camera.parameter_names if n.startswith("f"))
    f_px = float(probe.camera.parameters[0]) if focal else 1.0
    drift = Source(
        "focal_drift", "Focal length over temperature", Kind.SYSTEMATIC, "relative", 5e-5, focal, f_px
    )
    sources = (
        *((drift,) if focal else ()),
        Source("baseline_drift", "Baseline over temperature (Al, 5 K)", Kind.SYSTEMATIC, "mm",
               round(23e-6 * 5 * probe.laser.baseline_mm, 5), ("baseline_mm",)),
        Source("centre_drift", "Principal point over temperature, per axis", Kind.SYSTEMATIC, "px", 0.02,
               tuple(n for n in probe.camera.parameter_names if n in ("cx", "cy"))),
        Source("pixel_aspect", "Pixel aspect", Kind.SYSTEMATIC, "relative", 5e-5, ("aspect",)),
        Source("sensor_tilt", "Sensor tilt, per axis", Kind.SYSTEMATIC, "relative", 2e-5,
               ("sensor_tilt_x", "sensor_tilt_y")),
        Source("pupil_shift", "Pupil moves with the angle", Kind.SYSTEMATIC, "mm", 0.02, ("pupil_mm",)),
        Source("housing_glass", "Thickness of a glass tube", Kind.SYSTEMATIC, "mm", 0.0, ("glass_mm",)),
        Source("tube_wedge", "Wedge of a glass tube, per axis", Kind.SYSTEMATIC, "mm", 0.0,
               ("wedge_x_mm", "wedge_y_mm")),
        Source("dome_axial", "Dome along the axis", Kind.SYSTEMATIC, "mm", 0.0, ("dome_axial_mm",)),
        Source("dome_lateral", "Dome beside the axis, per axis", Kind.SYSTEMATIC, "mm", 0.0,
               ("dome_x_mm", "dome_y_mm")),
        Source("outside_index", "Medium outside a sealed probe", Kind.SYSTEMATIC, "index", 0.0,
               ("outside_index",)),
    )  # fmt: skip
    return tuple(source for source in sources if source.parameters)


RANDOM_SOURCES = (
    Source("line_width", "Laser line width (its own shot noise)", Kind.RANDOM, "px", math.nan,
           table_one="line width"),
    Source("image_noise", "Image noise", Kind.RANDOM, "px", math.nan, table_one="image noise"),
    Source("speckle", "Speckle", Kind.RANDOM, "px", math.nan),
    Source("albedo_bias", "Texture under the line", Kind.RANDOM, "px", math.nan),
    Source("pixel_locking", "Pixel locking and compression", Kind.RANDOM, "px", 0.014),
    Source("saturation", "Clipped peaks", Kind.RANDOM, "px", 0.01),
)  # fmt: skip

NOT_IN_RADIUS = {
    "off-centre, yaw, bend, ovality": "states that the motion estimate finds, not errors of the instrument",
    "encoder_scale, encoder_slip, time_offset": "they move distance, not radius",
    "rolling_shutter, motion_blur": "depend on the run's vibration; negligible with a short global shutter",
    "gamma, vignetting, ambient_light, subsurface, ghost_ring": "depend on exposure and wall; judged per run",
    "tube_tilt": "only known to first order on one side; needs a window",
}
"""Effects of the PHYSICS notes without a row, and why."""


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
