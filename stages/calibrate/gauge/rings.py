"""Rings on known bore: samples that belong to one section, condensed to azimuth bins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from stages.calibrate.gauge.geometry import Gauge
from stages.calibrate.gauge.parameters import GaugeParameters

_LEAST_SHARE = 0.5


@dataclass(frozen=True)
class BoreRings:
    """Ring bins on the gauge's bore.

    Attributes
    ----------
    frame : (M,) int
        Index of the frame in the recording.
    uv : (M, 2)
    outward : (M, 2)
        Unit direction of the image radius.
    sigma_px : (M,)
        1 σ along it.
    section : (M,) int
    radius_mm : (M,)
        Stated radius of the bore there.
    wall_mm : (M, 2)
        Distance and way around (azimuth × radius) of the point: neighbours on the wall err alike.
    left_out : dict of str to int
        Samples left out, by reason.
    """

    frame: Int
    uv: Float
    outward: Float
    sigma_px: Float
    section: Int
    radius_mm: Float
    wall_mm: Float
    left_out: dict[str, int]

    def select(self, keep: Bool) -> BoreRings:
        """Return the bins where ``keep`` (M,) is true."""
        parts = {k: v[keep] for k, v in vars(self).items() if k != "left_out"}
        return BoreRings(**parts, left_out=self.left_out)


def bore_rings(
    rings: RingSamples, index: Int, T_pc: Float, probe: Probe, gauge: Gauge, parameters: GaugeParameters
) -> BoreRings:
    """Return the bins of all rings, in frames (F,) ``index``, as poses (N, 4, 4) and probe place them."""
    uv = rings.pixels()
    xyz_p = transform(T_pc[index][:, None], probe.triangulate(np.where(rings.valid[..., None], uv, np.nan)))
    distance, azimuth = xyz_p[..., 2], np.arctan2(xyz_p[..., 1], xyz_p[..., 0])
    seen = np.isfinite(distance)
    s, a = np.where(seen, distance, 0.0), np.where(seen, azimuth, 0.0)
    clear_of_step = gauge.from_step_mm(s) > parameters.step_margin_mm
    margin = gauge.from_fiducial_edge_mm(s.ravel(), a.ravel()).reshape(s.shape)
    clear_of_fiducial = margin > parameters.fiducial_margin_mm
    use = seen & clear_of_step & clear_of_fiducial
    left_out = {
        "near a step of the bore": int((seen & ~clear_of_step).sum()),
        "near a fiducial": int((seen & clear_of_step & ~clear_of_fiducial).sum()),
    }
    return _condensed(rings, index, use, s, a, gauge, parameters.ring_bins, left_out)


def _condensed(
    rings: RingSamples, index: Int, use: Bool, distance_mm: Float, azimuth_rad: Float,
    gauge: Gauge, bins: int, left_out: dict[str, int],
) -> BoreRings:  # fmt: skip
    frames, azimuths = use.shape
    size = azimuths // bins
    cut, shape = slice(0, size * bins), (frames, bins, size)
    sigma = np.where(use, np.nan_to_num(rings.sigma_px.astype(float), nan=1.0), 1.0)[:, cut].reshape(shape)
    seen = use[:, cut].reshape(shape)
    weight = seen / sigma**2
    total = weight.sum(2)
    # A bin across a step would mix two bores.
    section = gauge.section(distance_mm)[:, cut].reshape(shape)
    lowest, highest = np.where(seen, section, 99).min(2), np.where(seen, section, -1).max(2)
    keep = (seen.sum(2) >= _LEAST_SHARE * size) & (lowest == highest)
    share = (weight / np.maximum(total, 1e-12)[..., None])[keep]
    image_azimuth = np.broadcast_to(rings.azimuth_rad, use.shape)
    radius, azimuth, distance = (
        np.sum(share * np.nan_to_num(x[:, cut].astype(float)).reshape(shape)[keep], 1)
        for x in (rings.radius_px, image_azimuth, distance_mm)
    )
    middle = np.where(seen, azimuth_rad[:, cut].reshape(shape), np.nan)[keep]
    around = np.nanmax(middle, 1) * gauge.radius_mm[lowest[keep]]
    outward = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    frame = np.broadcast_to(index[:, None], keep.shape)[keep]
    return BoreRings(
        frame, rings.centre_px + radius[:, None] * outward, outward, 1 / np.sqrt(total[keep]),
        lowest[keep], gauge.radius_mm[lowest[keep]], np.stack([distance, around], -1), left_out,
    )  # fmt: skip
