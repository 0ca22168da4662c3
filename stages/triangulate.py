"""Ring samples and instrument -> wall points in C, with noise and calibration covariance kept apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import Float, Float32, RingPoints, RingSamples
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.stage import Context, Parameters, Stage

_UPPER = np.triu_indices(3)
_CHUNK_FRAMES = 16


class TriangulateParameters(Parameters):
    """Triangulation is exact and has nothing to set."""


def triangulate_rings(
    rings: RingSamples, probe: Probe, parameters: TriangulateParameters, context: Context
) -> RingPoints:
    """Intersect the ray of every valid ring sample with the laser sheet.

    Parameters
    ----------
    rings
        Ring samples, px.
    probe
        Camera, laser sheet and their covariance.

    Returns
    -------
    RingPoints
        mm in C; NaN where the sample is invalid or its ray misses the sheet.
    """
    pieces = []
    for start in range(0, len(rings.frame), _CHUNK_FRAMES):
        pieces.append(_triangulate_chunk(rings, slice(start, start + _CHUNK_FRAMES), probe))
        context.progress(min(start + _CHUNK_FRAMES, len(rings.frame)), len(rings.frame))
    xyz, uncorrected, noise, covariance = (np.concatenate(p) for p in zip(*pieces, strict=True))
    _report(context, rings, xyz, noise)
    return RingPoints(rings.frame, rings.azimuth_rad, xyz, uncorrected, noise, covariance)


def untilted_sheet(laser: LaserSheet) -> LaserSheet:
    """Return the seed paper's assumption of ``laser``: the plane z = baseline, parallel to the image."""
    return replace(
        LaserSheet(laser.baseline_mm), line_sigma_mm=laser.line_sigma_mm, wavelength_nm=laser.wavelength_nm
    )


def calibration_covariance(by_parameters: Float, covariance: Float) -> Float:
    """Return J Σ Jᵀ as (..., 6) entries xx, xy, xz, yy, yz, zz of Jacobians (..., 3, P) and Σ (P, P)."""
    spread = by_parameters @ covariance
    return np.stack(
        [np.sum(spread[..., i, :] * by_parameters[..., j, :], -1) for i, j in zip(*_UPPER, strict=True)], -1
    )


def _triangulate_chunk(
    rings: RingSamples, frames: slice, probe: Probe
) -> tuple[Float32, Float32, Float32, Float32]:
    usable = rings.valid[frames]
    direction = np.stack([np.cos(rings.azimuth_rad), np.sin(rings.azimuth_rad)], -1)
    directions = np.broadcast_to(direction, (*usable.shape, 2))[usable]
    uv = rings.centre_px + rings.radius_px[frames][usable].astype(float)[:, None] * directions
    by_pixel, by_parameters = probe.triangulate_jacobian(uv)
    sigma = rings.sigma_px[frames][usable].astype(float)
    noise = np.einsum("nij,nj->ni", by_pixel, directions) * sigma[:, None]
    flat = replace(probe, laser=untilted_sheet(probe.laser))
    xyz, uncorrected = probe.triangulate(uv), flat.triangulate(uv)
    covariance = calibration_covariance(by_parameters, probe.covariance)
    xyz_c, flat_c = _spread(xyz, usable), _spread(uncorrected, usable)
    return xyz_c, flat_c, _spread(noise, usable), _spread(covariance, usable)


def _spread(values: Float, where: NDArray[np.bool_]) -> Float32:
    """Put rows of ``values`` (N, K) where ``where`` (F, A) is true, NaN elsewhere."""
    out = np.full((*where.shape, values.shape[-1]), np.nan, np.float32)
    out[where] = values
    return out


def _report(context: Context, rings: RingSamples, xyz: Float32, noise: Float32) -> None:
    placed = np.isfinite(xyz[..., 0])
    context.report("points triangulated", int(placed.sum()), "points")
    context.report("ring samples that miss the laser sheet", int((rings.valid & ~placed).sum()), "samples")
    if placed.any():
        length = np.linalg.norm(noise[placed], axis=-1)
        context.report("median point noise", float(np.median(length)), "mm")


TRIANGULATE = Stage(
    "triangulate",
    "1",
    TriangulateParameters,
    triangulate_rings,
    "ring samples and instrument to wall points with covariance",
)
