"""Rings condensed: where the pipe's axis passes each ring, and azimuth bins for the joint adjustment."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import interp1d

from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.measured import RingPoints, RingSamples
from pipeline.instrument.probe import Probe
from stages.motion.bundle_adjustment.residuals import RingBins

_FEWEST = 0.3
CORRELATED_FRAMES = 4.0
_AT_ONCE = 256


def ring_centres(points: RingPoints) -> tuple[Float, Float, Float]:
    """Return circle centre (F, 2), mm in C, radius (F,) and coverage (F,); NaN where a ring is too short.

    Algebraic circle fit (Kåsa), reweighted: the wall is round to a few tenths of a millimetre.
    """
    parts = [_circles(points.xyz_c[a : a + _AT_ONCE, :, :2]) for a in range(0, len(points.frame), _AT_ONCE)]
    centre, radius, coverage = (np.concatenate(p) for p in zip(*parts, strict=True))
    return centre, radius, coverage


def _circles(xy_c: Float32) -> tuple[Float, Float, Float]:
    """Return centre, radius and coverage of rings (F, A, 2)."""
    xy = xy_c.astype(float)
    seen = np.isfinite(xy).all(-1)
    x = np.where(seen[..., None], xy, 0.0)
    design = np.concatenate([x, np.ones_like(x[..., :1])], -1)
    target = np.sum(x * x, -1)
    weight = seen.astype(float)
    coverage = seen.mean(1)
    usable = coverage > _FEWEST
    out = np.full((len(xy), 3), np.nan)
    for _ in range(5):
        normal = np.einsum("fai,fa,faj->fij", design, weight, design)[usable]
        right = np.einsum("fai,fa,fa->fi", design, weight, target)[usable]
        out[usable] = np.linalg.solve(normal, right[..., None])[..., 0]
        error = target - np.einsum("fai,fi->fa", design, np.nan_to_num(out))
        size = np.where(seen & usable[:, None], np.abs(error), np.nan)
        scale = np.ones(len(xy))
        scale[usable] = robust_spreads(size[usable], axis=1)
        weight = seen / (1 + (error / (3 * np.maximum(scale, 1e-6))[:, None]) ** 2)
    centre = out[:, :2] / 2
    return centre, np.sqrt(out[:, 2] + np.sum(centre**2, 1)), coverage


def at_all_frames(frame: Int, value: Float, frames: int) -> Float:
    """Return values (frames, ...) at all frames, linear between the frames (F,) where they are not NaN."""
    ok = np.isfinite(value).reshape(len(value), -1).all(1)
    if ok.sum() < 2:
        only = value[ok][0] if ok.any() else np.zeros(value.shape[1:])
        return np.broadcast_to(only, (frames, *only.shape)).copy()
    ends = (value[ok][0], value[ok][-1])
    line = interp1d(frame[ok], value[ok], axis=0, bounds_error=False, fill_value=ends)
    return np.asarray(line(np.arange(frames)))


def ring_bins(rings: RingSamples, probe: Probe, unsure: Float, bins: int, wall_sigma_mm: float) -> RingBins:
    """Condense each ring to the mean of every azimuth bin that is at least half seen.

    ``unsure`` (P, Q) are the instrument's principal uncertainties. The wall's own relief is alike in
    neighbouring frames, so σ is widened by the root of that many frames.
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
    noise_mm = np.linalg.norm(np.einsum("mij,mj->mi", by_pixel, outward), axis=1) * noise_px
    sigma = np.sqrt(CORRELATED_FRAMES * wall_sigma_mm**2 + noise_mm**2)
    frame = np.broadcast_to(rings.frame[:, None], keep.shape)[keep]
    xyz_c = probe.triangulate(uv)
    ok = np.isfinite(xyz_c).all(1)
    return RingBins(frame[ok], xyz_c[ok], (by_parameters @ unsure)[ok], sigma[ok])
