"""Laser rings in the motion stage: circles through them, and azimuth bins for the bundle adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.interpolate import interp1d

from pipeline.adjustment.circles import LEAST_COVERED, circles_through
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording
from stages.premises.stays import in_full

CORRELATED_FRAMES = 4.0
"""Neighbouring frames in which a ring meets the same relief of the wall, so that their errors are the same:
the relief's length along the pipe over the distance from ring to ring. Assumed for all recordings, not
measured."""
_FEWEST_RINGS = 3
_MOST_NOT_ON_WALL = 0.5
"""Texture is not followed in a sector in which at least this share of the rings shows no wall. A choice."""
_FARTHEST_PX = 20.0
"""A ring farther than this, px, from its expected place is a hole or an outlier, of little weight. Up to this
distance derivatives change linearly: with relief of 5 px rms no bias remains. A choice."""


@dataclass(frozen=True)
class RingBins:
    """Rings condensed to azimuth bins.

    Attributes
    ----------
    frame : (M,) int
    xyz_c : (M, 3)
        Mean point, mm in C, with the instrument as stated.
    by_instrument : (M, 3, Q)
        Its change with the instrument's principal uncertainties, mm per σ.
    by_pixel : (M, 3)
        Its change with the ring's radius in the image, mm per px.
    instrument_by_pixel : (M, 3, Q)
        Change of ``by_instrument`` with that radius, per px.
    sigma_mm : (M,)
        1 σ of its radius: noise and relief of the wall.
    """

    frame: Int
    xyz_c: Float
    by_instrument: Float
    by_pixel: Float
    instrument_by_pixel: Float
    sigma_mm: Float

    @staticmethod
    def joined(parts: Sequence[RingBins]) -> RingBins:
        """Return the bins of several parts of a run, one after the other."""
        return RingBins(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(RingBins)))

    def instrument_where_expected(self, residual_mm: Float, normal_c: Float) -> Float:
        """Return ``by_instrument`` at the places where the pipe's model expects the rings.

        ``residual_mm`` (M,) is the distance of each measured ring from there, along ``normal_c`` (M, 3).
        Derivatives at the measured places would follow the wall's relief, and their product with the residual
        has a mean that is not zero: in open-1-field it moved radius and distance by 0.15 σ (W. A. Fuller,
        "Measurement Error Models", 1987, ch. 3).
        """
        away = residual_mm / np.einsum("mi,mi->m", normal_c, self.by_pixel)
        away = np.clip(away, -_FARTHEST_PX, _FARTHEST_PX)
        return np.asarray(self.by_instrument - away[:, None, None] * self.instrument_by_pixel)


@dataclass(frozen=True)
class RingCircles:
    """Circles through the rings.

    Attributes
    ----------
    frame : (F,) int
        Frame numbers.
    centre_c : (F, 2)
        Point at which the pipe's axis passes through the laser's plane, mm in C; NaN where too little of a
        ring is seen.
    radius_mm : (F,)
    """

    frame: Int
    centre_c: Float
    radius_mm: Float

    @property
    def usual_radius_mm(self) -> float:
        """Return the median radius."""
        return float(np.nanmedian(self.radius_mm))

    def centre_at(self, frame: Int) -> Float:
        """Return the centre (N, 2) in all frames of the recording, linear between rings; 0 without any."""
        ok = np.isfinite(self.centre_c).all(1)
        place, value = np.searchsorted(frame, self.frame[ok]), self.centre_c[ok]
        if len(value) < 2:
            return np.broadcast_to(value[0] if len(value) else np.zeros(2), (len(frame), 2)).copy()
        line = interp1d(place, value, axis=0, bounds_error=False, fill_value=(value[0], value[-1]))
        return np.asarray(line(np.arange(len(frame))))


def circles_in_rings(points: RingPoints) -> RingCircles:
    """Fit a circle to each ring.

    Raises
    ------
    UnusableError
        When fewer than three rings show enough of their circle.
    """
    centre, radius = circles_through(points.xyz_c[..., :2])
    if np.isfinite(radius).sum() < _FEWEST_RINGS:
        raise UnusableError(
            "motion",
            f"only {int(np.isfinite(radius).sum())} laser frames show enough of a ring to locate the pipe",
            limit=f"{_FEWEST_RINGS} rings seen over {100 * LEAST_COVERED:.0f} % of the circle",
            hint="check the exposure and that the laser is on; the report lists rejected samples by reason",
        )
    return RingCircles(points.frame, centre, radius)


def looking_at_wall(recording: Recording, rings: RingSamples, points: RingPoints) -> Recording:
    """Return the recording without those sectors of the picture in which most rings have no line on the wall.

    Standing water mirrors the wall above it, so that texture seen there belongs to other wall.
    """
    lost = (rings.valid & np.isnan(points.xyz_c[..., 0])).mean(0) > _MOST_NOT_ON_WALL
    if not lost.any():
        return recording
    width, height = recording.source.image_size
    v, u = np.ogrid[:height, :width]
    turns = (np.arctan2(v - rings.centre_px[1], u - rings.centre_px[0]) - rings.azimuth_rad[0]) / (2 * np.pi)
    hidden = lost[np.rint(turns * len(lost)).astype(int) % len(lost)]
    stays = in_full(recording.stays, (width, height))
    return replace(recording, stays=hidden if stays is None else hidden | (stays > 0))


def ring_bins(rings: RingSamples, place: Int, probe: Probe, bins: int, wall_sigma_mm: float) -> RingBins:
    """Condense each ring to the mean of every azimuth bin that is at least half seen.

    Parameters
    ----------
    rings
    place : (F,) int
        Indices of the rings' frames in the list of frames.
    probe
    bins : int
        Azimuth bins of a ring.
    wall_sigma_mm : float
        1 σ of the wall around the smooth pipe. The relief is the same in neighbouring frames, so it is
        widened by the root of `CORRELATED_FRAMES`.
    """
    frames, azimuths = rings.radius_px.shape
    size = azimuths // bins
    cut = slice(0, size * bins)
    seen = rings.valid[:, cut].reshape(frames, bins, size)
    count = seen.sum(2)
    keep = count * 2 >= size
    weight = seen / np.maximum(count, 1)[..., None]
    radius = np.nan_to_num(rings.radius_px[:, cut].astype(float)).reshape(seen.shape)
    noise = np.nan_to_num(rings.sigma_px[:, cut].astype(float)).reshape(seen.shape)
    azimuth = np.sum(weight * rings.azimuth_rad[cut].reshape(bins, size), 2)[keep]
    mean, noise_px = np.sum(weight * radius, 2)[keep], np.sqrt(np.sum((weight * noise) ** 2, 2))[keep]
    outward = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    uv = rings.centre_px + mean[:, None] * outward
    by_pixel, by_parameters = probe.triangulate_jacobian(uv)
    by_pixel = np.einsum("mij,mj->mi", by_pixel, outward)
    noise_mm = np.linalg.norm(by_pixel, axis=1) * noise_px
    sigma = np.sqrt(CORRELATED_FRAMES * wall_sigma_mm**2 + noise_mm**2)
    frame = np.broadcast_to(place[:, None], keep.shape)[keep]
    xyz_c = probe.triangulate(uv)
    unsure = probe.principal_uncertainties()
    by_instrument = by_parameters @ unsure
    farther = probe.triangulate_jacobian(uv + outward)[1] @ unsure - by_instrument
    ok = np.isfinite(np.column_stack([xyz_c, sigma])).all(1) & np.isfinite(farther).all((1, 2))
    return RingBins(frame[ok], xyz_c[ok], by_instrument[ok], by_pixel[ok], farther[ok], sigma[ok])
