"""Laser rings in the motion stage: circles through them, and azimuth bins for the bundle adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.interpolate import interp1d
from scipy.ndimage import maximum_filter1d

from pipeline.adjustment.circles import LEAST_COVERED, circles_through
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording
from stages.premises.stays import in_full

CORRELATED_FRAMES = 4.0
"""Neighbouring frames in which a ring meets the same relief of the wall, so that their errors are alike: the
relief's length along the pipe over the way from ring to ring. Taken for all recordings, not measured."""
_FEWEST_RINGS = 3
_MOST_NOT_ON_WALL = 0.5
"""Share of the rings that show no wall in a sector, from which its texture is not followed. A choice:
half is most of the way."""
_STEP_MM = 0.5
"""Change of radius that counts as a step of the bore: five times the relief about the smooth pipe
(`surface_sigma_mm`). A choice."""
_LENGTH_RADII, _FEWEST_RINGS_OF_LENGTH = 0.5, 5
"""A length of a bore is at least half its radius long: welds and rings of deposit are shorter. A choice."""
_FARTHEST_PX = 20.0
"""A ring farther than this from where it is expected is a hole or an outlier, of little weight. Up to there
derivatives change evenly: with relief of 5 px rms nothing is left of their pull. A choice."""


@dataclass(frozen=True)
class RingBins:
    """Rings condensed to azimuth bins.

    Attributes
    ----------
    frame : (M,) int
    xyz_c : (M, 3)
        Mean point with the instrument as stated.
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
        """Return ``by_instrument`` where the pipe puts the ring, which is off it by (M,) along (M, 3) in C.

        Derivatives where it was found follow the wall's relief there, and their product with the residual has
        a mean: in open-1-field it moved radius and distance by 0.15 σ (W. A. Fuller, "Measurement Error
        Models", 1987, ch. 3).
        """
        away = residual_mm / np.einsum("mi,mi->m", normal_c, self.by_pixel)
        away = np.clip(away, -_FARTHEST_PX, _FARTHEST_PX)
        return np.asarray(self.by_instrument - away[:, None, None] * self.instrument_by_pixel)


@dataclass(frozen=True)
class BoreSteps:
    """Where the bore steps (k,), and how much wider (k + 1,) than the longest the lengths between are, mm.

    A pipe of one bore has no steps. Held to one radius, two bores 2 mm apart moved the probe by 20 σ. From
    ``aside_from_mm`` on the pipe lies farther across by ``aside_mm``, along x and y of its sections.
    """

    at_mm: Float
    wider_mm: Float
    aside_from_mm: float = np.inf
    aside_mm: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def of(radius_mm: Float, at_mm: Float) -> BoreSteps:
        """Return the steps that radii (F,) of rings at distances (F,) show; NaN where a ring has none."""
        order = np.argsort(at_mm, kind="stable")
        order = order[np.isfinite(radius_mm[order])]
        radius_mm, at_mm = radius_mm[order], at_mm[order]
        if len(radius_mm) < 2 * _FEWEST_RINGS_OF_LENGTH + 2:
            return NO_STEPS
        n = rings_of_length(radius_mm, at_mm)
        if len(radius_mm) < 2 * n + 2:
            return NO_STEPS
        median = np.median(np.lib.stride_tricks.sliding_window_view(radius_mm, n), axis=1)
        size = np.abs(median[n + 1 :] - median[: -n - 1])  # of a step at ring n + k
        highest = size == maximum_filter1d(size, 2 * n + 1)
        place = n + np.flatnonzero(highest & (size > _STEP_MM))
        near = place[np.diff(place, prepend=-n) >= n]
        place = np.array([_stepped_at(radius_mm, int(k), n) for k in near], np.int64)
        lengths = np.split(radius_mm, place)
        usual = np.array([np.median(part) for part in lengths])
        return BoreSteps(at_mm[place], usual - usual[np.argmax([len(part) for part in lengths])])

    def wider_at(self, distance_mm: Float) -> Float:
        """Return how much wider (M,) the bore is at distances (M,), mm."""
        return np.asarray(self.wider_mm[np.searchsorted(self.at_mm, distance_mm)])

    def behind(self, start_mm: float) -> BoreSteps:
        """Return the steps with distance counted from ``start_mm``."""
        return replace(self, at_mm=self.at_mm - start_mm, aside_from_mm=self.aside_from_mm - start_mm)

    def with_joint(self, at_mm: float, aside_mm: tuple[float, float], wider_mm: float) -> BoreSteps:
        """Return the steps with a joint behind which the pipe lies aside and is wider."""
        place = int(np.searchsorted(self.at_mm, at_mm))
        wider = np.insert(self.wider_mm, place, self.wider_mm[place])
        wider[place + 1 :] += wider_mm
        return BoreSteps(np.insert(self.at_mm, place, at_mm), wider, at_mm, aside_mm)

    def off_at(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return how much farther from the axis the wall is (M,) at distances and azimuths (M,), mm."""
        (x, y), behind = self.aside_mm, distance_mm > self.aside_from_mm
        return self.wider_at(distance_mm) + behind * (x * np.cos(azimuth_rad) + y * np.sin(azimuth_rad))


NO_STEPS = BoreSteps(np.zeros(0), np.zeros(1))


@dataclass(frozen=True)
class RingCircles:
    """Circles through the rings.

    Attributes
    ----------
    frame : (F,) int
        Frame numbers.
    centre_c : (F, 2)
        Where the pipe's axis passes the laser's plane, mm in C; NaN where too little of a ring is seen.
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
            f"only {int(np.isfinite(radius).sum())} laser frames show enough of a ring to place the pipe",
            limit=f"{_FEWEST_RINGS} rings seen over {100 * LEAST_COVERED:.0f} % of the circle",
            hint="check exposure and that the laser is on; see the rejected ring samples by reason",
        )
    return RingCircles(points.frame, centre, radius)


def looking_at_wall(recording: Recording, rings: RingSamples, points: RingPoints) -> Recording:
    """Return the recording without the sectors of the picture in which most rings' line is not on the wall.

    In standing water the wall above is mirrored: its texture there lies elsewhere, too.
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


def rings_of_length(radius_mm: Float, at_mm: Float) -> int:
    """Return how many rings, with radii (F,) at distances (F,), the shortest length of a bore has."""
    apart_mm = max(float(np.ptp(at_mm)) / len(at_mm), 1e-9)
    return max(round(_LENGTH_RADII * float(np.median(radius_mm)) / apart_mm), _FEWEST_RINGS_OF_LENGTH)


def ring_bins(rings: RingSamples, place: Int, probe: Probe, bins: int, wall_sigma_mm: float) -> RingBins:
    """Condense each ring to the mean of every azimuth bin that is at least half seen.

    Parameters
    ----------
    rings
    place : (F,) int
        Places of the rings in the list of frames.
    probe
    bins : int
        Azimuth bins of a ring.
    wall_sigma_mm : float
        1 σ of the wall about the smooth pipe. The relief is alike in neighbouring frames, so it is widened by
        the root of `CORRELATED_FRAMES`.
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


def _stepped_at(radius_mm: Float, near: int, n: int) -> int:
    """Return the first ring behind a step: medians of ``n`` rings tell it to half as many only."""
    part = radius_mm[near - n : near + n + 1]
    before, behind = np.abs(part - np.median(part[:n])), np.abs(part - np.median(part[n + 1 :]))
    return near - n + int(np.argmin([before[:k].sum() + behind[k:].sum() for k in range(len(part))]))
