"""The laser's line as a picture shows it, measured along directions from the stated centre."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from pipeline.arrays import Float, Float32
from pipeline.simulator.truth import SceneTruth

# A centroid's window, the steps along a radius in which it is taken, and how far about the line it is sought.
WINDOW_PX, _STEP_PX, _REACH_PX = 6.0, 0.25, 30.0
_CENTRINGS = 3


class SeenLine(NamedTuple):
    """Moments of the light within `WINDOW_PX` of the line, along each azimuth.

    Attributes
    ----------
    radius_px : (A,)
        Centroid, from the stated centre.
    light : (A,)
        Sum along the radius, full scales × px.
    width_px, skewness : (A,)
        1 σ and third standardised moment.
    """

    radius_px: Float
    light: Float
    width_px: Float
    skewness: Float


def seen_line(picture: Float32, truth: SceneTruth, azimuth_rad: Float) -> SeenLine:
    """Return the line of a picture (H, W) along azimuths (A,)."""
    rho, grey = unrolled(picture, truth, azimuth_rad, _REACH_PX, _STEP_PX)
    middle = rho[np.argmax(grey, axis=1)]
    weight = grey
    for _ in range(_CENTRINGS):
        weight = grey * (np.abs(rho - middle[:, None]) <= WINDOW_PX)
        middle = np.sum(weight * rho, 1) / np.maximum(np.sum(weight, 1), 1e-12)
    total = np.maximum(np.sum(weight, 1), 1e-12)
    off = rho - middle[:, None]
    variance, third = (np.sum(weight * off**n, 1) / total for n in (2, 3))
    return SeenLine(middle, total * _STEP_PX, np.sqrt(variance), third / variance**1.5)


def unrolled(
    picture: Float32, truth: SceneTruth, azimuth_rad: Float, reach_px: float, step_px: float
) -> tuple[Float, Float]:
    """Return image radii (N,) about where the ring is expected, and the picture there (A, N)."""
    expected = expected_px(truth)
    rho = np.arange(expected - reach_px, expected + reach_px, step_px)
    centre = truth.stated.camera.centre_px
    u, v = (c + rho * f(azimuth_rad)[:, None] for c, f in zip(centre, (np.cos, np.sin), strict=True))
    grey = map_coordinates(spline_filter(picture.astype(float)), [v, u], prefilter=False)
    return rho, np.maximum(grey, 0.0)


def read_radii(line_px: Float, truth: SceneTruth, azimuth_rad: Float) -> Float:
    """Return the radius (A,), mm, that the stated instrument makes of a line."""
    outward = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)
    point = truth.stated.triangulate(truth.stated.camera.centre_px + line_px[:, None] * outward)
    return np.asarray(np.hypot(point[:, 0], point[:, 1]))


def expected_px(truth: SceneTruth) -> float:
    """Return where the stated instrument would see the ring of a centred round pipe."""
    place = np.array([truth.facts.nominal_diameter_mm / 2, 0.0, truth.stated.laser.baseline_mm])
    return float(np.linalg.norm(truth.stated.camera.project(place).uv - truth.stated.camera.centre_px))
