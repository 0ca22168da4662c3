"""Compares the wall as the laser line shows it with the wall as texture alone shows it, place by place.

Water on the window, uneven glass, a lens that is not as stated, or a codec displace the picture smoothly.
Poses and landmarks follow, so that residuals hardly show it, and what displaces the line is taken for the
wall's shape. But texture passes a place of the wall elsewhere in the picture, and at another time, than the
line does. If both measure the same wall, their difference is noise, and noise of neighbouring landmarks is
independent: what neighbours share is an error of the picture, of the lens, or of the sheet of laser light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.adjustment.robust import GemanMcClure, robust_spread
from pipeline.arrays import Bool, Float, Int
from pipeline.geometry.axis import to_pipe
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.extra_columns import RingsInPipe
from stages.motion.bundle_adjustment.shared_difference import WallTwice
from stages.motion.bundle_adjustment.solver import Estimate

_NEAREST, _FARTHEST = 1.0, 2.5
"""Distance of neighbours, in sizes of a patch. Nearer ones share samples and therefore noise; farther ones
are displaced differently. Up to 1.5 or 3.5 sizes the result is the same within a twentieth."""
_BESIDE = 0.5
"""Distance of rings that are compared with a landmark, in sizes of a patch: its own wall, and half the least
distance of neighbours, which so share no rings and no noise of them. Up to one size, waves of the wall 1 mm
high and 40 mm long were flattened in the mean, and counted as displaced by .03 mm."""
_OF_VIEW = 0.5
"""Length over which a misfit of poses is taken for linear, in lengths of the wall in view. Poses see what
they do not fit, such as a joint that the adjustment does not know, as long as it is in view, and follow it
over that length: a half wave. Of it .09 of the size remain beside a line over half of the view, .32 over all
of it; there a joint of 1 mm counted by 17 standard errors. A film of water counted as much with a quarter of
to twice the view."""
_ITERATIONS, _REDESCENT, _CLIPPED = 8, 3.0, 3.0
"""Reweightings, and robust spreads at which differences lose weight or are clipped: edges, false matches."""


@dataclass(frozen=True)
class _Compared:
    """Landmarks at which photo and line are compared.

    Attributes
    ----------
    place : (L, 3)
        On a cylinder of the pipe's radius, mm.
    difference_mm, sigma_mm : (L,)
        Photo minus line, and its 1 σ.
    part : (L,) int
        Number of the part of the pipe, each as long as the least distance of neighbours.
    frame, azimuth_c_rad : (L,)
        Frame of the nearest ring, and the azimuth in the image at which it passes.
    """

    place: Float
    difference_mm: Float
    sigma_mm: Float
    part: Int
    frame: Int
    azimuth_c_rad: Float


def wall_twice(estimate: Estimate, measured: Measurements, patch_mm: float, view_mm: float) -> WallTwice:
    """Compare texture and line at an estimate.

    ``patch_mm`` is the size of a tracked patch on the wall, ``view_mm`` the length of pipe in which texture
    is tracked in one picture.
    """
    state = estimate.state
    off_mm, sigma_mm = _texture_alone(estimate)
    span, azimuth, _ = to_pipe(state.axis, state.xyz_p)
    rings, radius_mm = RingsInPipe.of(state, measured), state.nominal_radius_mm
    place = _on_cylinder(span, azimuth, radius_mm)
    on_rings = _on_cylinder(rings.span_mm, rings.azimuth_rad, radius_mm)
    line_mm = _mean_near(place, on_rings, estimate.adjusted.equations.rings.residual, _BESIDE * patch_mm)
    known = np.isfinite(line_mm + sigma_mm)
    if not known.any():
        return WallTwice.none()
    span, azimuth, place, sigma_mm = span[known], azimuth[known], place[known], sigma_mm[known]
    difference = _beyond_pose(span, azimuth, (off_mm - line_mm)[known], sigma_mm, _OF_VIEW * view_mm)
    part = np.floor((span - span.min()) / (_NEAREST * patch_mm)).astype(np.int64)
    nearest = cKDTree(on_rings).query(place)[1]
    x, y = rings.xyz_c[nearest, :2].T
    compared = _Compared(place, difference, sigma_mm, part, measured.rings.frame[nearest], np.arctan2(y, x))
    return _summed(compared, patch_mm, round(2 * np.pi * radius_mm / (_FARTHEST * patch_mm)))


def _texture_alone(estimate: Estimate) -> tuple[Float, Float]:
    """Return each landmark's distance from the smooth pipe (L,) by its matches alone, and its σ.

    The adjustment holds landmarks to the pipe. At its poses, this is undone. σ is NaN where it is unknown.
    """
    texture = estimate.adjusted.equations.texture
    weight, normal = texture.weight, texture.surface_by_point
    information = _sums(
        np.einsum("mci,mcj,m->mij", texture.by_point, texture.by_point, weight), texture.start
    )
    right = _sums(np.einsum("mci,mc,m->mi", texture.by_point, texture.residual, weight), texture.start)
    good = _regular(information)
    covariance = np.full_like(information, np.nan)
    covariance[good] = np.linalg.inv(information[good])
    along = np.einsum("lij,lj->li", covariance, normal)
    off_mm = texture.surface_residual - np.einsum("li,li->l", along, right)
    return off_mm, np.sqrt(np.einsum("li,li->l", along, normal))


def _sums(values: Float, start: Int) -> Float:
    """Return the sums (L, ...) of the rows (M, ...) from each start (L + 1,) to the next."""
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    return np.asarray(total[start[1:]] - total[start[:-1]])


def _regular(information: Float) -> Bool:
    """Return which matrices (L, 3, 3) can be inverted: a landmark seen along one ray has no place on it."""
    value = np.linalg.eigvalsh(information)
    return np.asarray(value[:, 0] > 1e-8 * value[:, 2])


def _on_cylinder(span_mm: Float, azimuth_rad: Float, radius_mm: float) -> Float:
    across = radius_mm * np.cos(azimuth_rad), radius_mm * np.sin(azimuth_rad)
    return np.stack([span_mm, *across], -1)


def _mean_near(place: Float, rings: Float, residual_mm: Float, within_mm: float) -> Float:
    """Return the rings' mean residual (L,) around places (L, 3).

    It is NaN where there is no ring, and where the rings around differ more than usual: at a joint, or an
    edge of a defect, a mean is not the wall at the place.
    """
    if not len(rings):
        return np.full(len(place), np.nan)
    near = cKDTree(rings).query_ball_point(place, within_mm)
    mean = np.array([residual_mm[k].mean() if k else np.nan for k in near])
    differ = np.array([residual_mm[k].std() if k else 0.0 for k in near])
    usual = np.median(differ[differ > 0]) if (differ > 0).any() else 0.0
    return np.where(differ > _CLIPPED * usual, np.nan, mean)


def _beyond_pose(
    span_mm: Float, azimuth_rad: Float, difference_mm: Float, sigma_mm: Float, length_mm: float
) -> Float:
    """Return the differences (L,) without mean and first harmonic along each length, outliers clipped.

    Their mean is a matter of the probe's scale, which has its own σ; the first harmonic is one of the pose,
    and is taken out of the wall.
    """
    out, part = np.zeros(len(span_mm)), np.floor((span_mm - span_mm.min(initial=0.0)) / length_mm)
    for k in np.unique(part):
        of = part == k
        out[of] = _without_harmonic(span_mm[of], azimuth_rad[of], difference_mm[of], sigma_mm[of])
    return out


def _without_harmonic(span_mm: Float, azimuth_rad: Float, difference_mm: Float, sigma_mm: Float) -> Float:
    along = (span_mm - span_mm.mean()) / max(float(np.ptp(span_mm)), 1e-9)
    around = np.stack([np.ones_like(along), np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)
    design = np.concatenate([around, along[:, None] * around], 1) / sigma_mm[:, None]
    left = in_sigma = difference_mm / sigma_mm
    for _ in range(_ITERATIONS):
        loss = GemanMcClure(_REDESCENT * max(robust_spread(left), 1e-9))
        weight = np.sqrt(loss.weight(left, np.ones_like(left)))
        fit = np.linalg.lstsq(design * weight[:, None], in_sigma * weight, rcond=None)[0]
        left = in_sigma - design @ fit
    limit = _CLIPPED * robust_spread(left)
    return np.asarray(np.clip(left, -limit, limit) * sigma_mm)


def _summed(compared: _Compared, patch_mm: float, sectors: int) -> WallTwice:
    """Return the sums over all pairs, by parts in the order of their frames."""
    count = int(compared.part.max()) + 1
    landmarks = np.bincount(compared.part, minlength=count)
    frame = np.bincount(compared.part, compared.frame, count) / np.maximum(landmarks, 1)
    weight = compared.sigma_mm**-2.0
    sector = np.floor((compared.azimuth_c_rad / (2 * np.pi) + 0.5) * sectors).astype(np.int64) % sectors
    cell, cells = compared.part * sectors + sector, count * sectors
    total, weights = (
        np.asarray(np.bincount(cell, v, cells), float).reshape(count, sectors)
        for v in (compared.difference_mm * weight, weight)
    )
    order = np.argsort(frame, kind="stable")
    order = order[landmarks[order] > 0]
    neighbours = _neighbours(compared, patch_mm, count)
    return WallTwice(frame[order], neighbours[order], total[order], weights[order])


def _neighbours(compared: _Compared, patch_mm: float, count: int) -> Float:
    """Return the sums (K, 3) over pairs of neighbours, as in `Shared`, by the part of one of the two."""
    place, sigma_mm = compared.place, compared.sigma_mm
    one, other = cKDTree(place).query_pairs(_FARTHEST * patch_mm, output_type="ndarray").T
    apart = np.linalg.norm(place[one] - place[other], axis=1) >= _NEAREST * patch_mm
    one, other = one[apart], other[apart]
    weight = (sigma_mm[one] * sigma_mm[other]) ** -2.0
    product = compared.difference_mm[one] * compared.difference_mm[other] * weight
    sums = [np.bincount(compared.part[one], v, count) for v in (product, product**2, weight)]
    return np.stack(sums, -1)
