"""The gauge: stepped bore and fiducials as points on its wall in P, and the rings on its known bore."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Fiducials, PipeFacts
from stages.calibrate.gauge.state import GaugeParameters

# Corners as ArUco numbers them, clockwise from the pattern's top left: (column, row) from -1 to 1.
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_LEAST_SHARE = 0.5


@dataclass(frozen=True)
class Gauge:
    """A gauge of known bore with known fiducials.

    Attributes
    ----------
    start_mm : (S,)
        Distance at which each bore section starts. The first also counts before its start, the last has no
        end.
    radius_mm : (S,)
    radius_sigma_mm : float
        1 σ of each section's radius, from the tolerance of its diameter.
    fiducials : Fiducials
    """

    start_mm: Float
    radius_mm: Float
    radius_sigma_mm: float
    fiducials: Fiducials

    @property
    def ids(self) -> Int:
        """(M,) numbers of the fiducials, as listed."""
        return np.array([m.id for m in self.fiducials.markers], np.int64)

    def section(self, distance_mm: Float) -> Int:
        """Return the section (...) in which a distance lies."""
        return np.clip(np.searchsorted(self.start_mm, distance_mm, "right") - 1, 0, len(self.start_mm) - 1)

    def from_step_mm(self, distance_mm: Float) -> Float:
        """Return the distance (...), mm, from the nearest step; infinite for a plain bore."""
        if len(self.start_mm) < 2:
            return np.full(np.shape(distance_mm), np.inf)
        return np.asarray(np.abs(np.asarray(distance_mm)[..., None] - self.start_mm[1:]).min(-1))

    def on_wall(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return wall points (..., 3) in P."""
        radius = self.radius_mm[self.section(distance_mm)]
        return np.stack([radius * np.cos(azimuth_rad), radius * np.sin(azimuth_rad), distance_mm], -1)

    def on_marker(self, index: Int, local: Float) -> Float:
        """Return points (..., 3) in P of fiducials (...) at (column, row) (..., 2), edges at ±1."""
        half = self.fiducials.size_mm / 2
        marker = [self.fiducials.markers[int(i)] for i in np.ravel(index)]
        centre = np.array([m.distance_mm for m in marker]).reshape(np.shape(index))
        azimuth = np.radians([m.azimuth_deg for m in marker]).reshape(np.shape(index))
        across = 1.0 if self.fiducials.columns_along == "+azimuth" else -1.0
        along = 1.0 if self.fiducials.rows_along == "+distance" else -1.0
        radius = self.radius_mm[self.section(centre)]
        return self.on_wall(
            centre + along * half * local[..., 1], azimuth + across * half * local[..., 0] / radius
        )

    def corners(self, index: Int) -> Float:
        """Return the corners (M, 4, 3) in P of fiducials (M,)."""
        return self.on_marker(
            np.repeat(np.asarray(index)[:, None], 4, 1), np.tile(_CORNERS, (len(index), 1, 1))
        )

    def from_fiducial_edge_mm(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return the distance (N,), mm, of wall points from the nearest fiducial's border; 0 inside.

        Inside a fiducial its pattern disturbs the line as its border does.
        """
        at = np.array([[m.distance_mm, np.radians(m.azimuth_deg)] for m in self.fiducials.markers])
        radius = self.radius_mm[self.section(distance_mm)]
        return np.asarray(_from_squares(distance_mm, azimuth_rad, radius, at, self.fiducials.size_mm / 2))


@numba.njit(cache=True, nogil=True)
def _from_squares(distance_mm, azimuth_rad, radius_mm, at, half_mm):  # type: ignore[no-untyped-def]
    """Return the distance (N,), mm, of wall points from the nearest square; 0 inside.

    Squares have their middle at (distance, azimuth) ``at`` (K, 2), and half sides ``half_mm``.
    """
    out = np.full(len(distance_mm), np.inf)
    for n in range(len(distance_mm)):
        for k in range(len(at)):
            along = max(abs(distance_mm[n] - at[k, 0]) - half_mm, 0.0)
            if along >= out[n]:
                continue
            turn = (azimuth_rad[n] - at[k, 1] + np.pi) % (2 * np.pi) - np.pi
            around = max(abs(turn) * radius_mm[n] - half_mm, 0.0)
            out[n] = min(out[n], np.hypot(along, around))
    return out


def gauge_of(facts: PipeFacts, fiducials: Fiducials) -> Gauge:
    """Return the gauge that a recording's facts describe; the tolerance is taken as a uniform ± range."""
    length = np.array([b.length_mm for b in facts.bore])
    start = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    radius = np.array([b.diameter_mm for b in facts.bore]) / 2
    return Gauge(start, radius, facts.bore_tolerance_mm / 2 / np.sqrt(3), fiducials)


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
        Distance and arc length (azimuth × radius) of the point: neighbours on the wall have common errors.
    across_px : (M,)
        Change of the image radius from one side of the bin to the other.
    left_out : dict of str to int
        Numbers of samples left out, by reason.
    """

    frame: Int
    uv: Float
    outward: Float
    sigma_px: Float
    section: Int
    radius_mm: Float
    wall_mm: Float
    across_px: Float
    left_out: dict[str, int]

    def select(self, keep: Bool) -> BoreRings:
        """Return the bins where ``keep`` (M,) is true."""
        parts = {k: v[keep] for k, v in vars(self).items() if k != "left_out"}
        return BoreRings(**parts, left_out=self.left_out)


def bore_rings(
    rings: RingSamples, index: Int, T_pc: Float, probe: Probe, gauge: Gauge, parameters: GaugeParameters
) -> BoreRings:
    """Return the bins of all rings, in frames (F,) ``index``, at poses (N, 4, 4) with a probe."""
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
    samples = [
        np.nan_to_num(x[:, cut].astype(float)).reshape(shape)[keep]
        for x in (rings.radius_px, image_azimuth, distance_mm)
    ]
    radius, azimuth, distance = (np.sum(share * x, 1) for x in samples)
    off = samples[1] - azimuth[:, None]
    slope = np.sum(share * off * samples[0], 1) / np.maximum(np.sum(share * off**2, 1), 1e-12)
    middle = np.where(seen, azimuth_rad[:, cut].reshape(shape), np.nan)[keep]
    around = np.nanmax(middle, 1) * gauge.radius_mm[lowest[keep]]
    outward = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    frame = np.broadcast_to(index[:, None], keep.shape)[keep]
    return BoreRings(
        frame, rings.centre_px + radius[:, None] * outward, outward, 1 / np.sqrt(total[keep]),
        lowest[keep], gauge.radius_mm[lowest[keep]], np.stack([distance, around], -1),
        slope * 2 * np.pi / bins, left_out,
    )  # fmt: skip
