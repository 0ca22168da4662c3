"""What is left of the wall when its own smooth shape and the motion of single rings are taken out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.ndimage import find_objects, gaussian_filter1d, label, median_filter

from pipeline.artefacts import RadiusMap
from stages.defects.parameters import DefectParameters

Float = NDArray[np.float64]
Mask = NDArray[np.bool_]

_HARMONICS = 2
_MAD = 1.4826
_TUKEY = 4.685
_SECTORS = 240


@dataclass(frozen=True)
class Relief:
    """Deviation of the wall from its own smooth shape, mm, positive into the wall.

    Attributes
    ----------
    distance_mm : (S,)
    azimuth_rad : (A,)
    radius_mm : float
        Mean radius.
    local_mm : (S, A)
        Without whatever goes all round: for defects of a part of the circumference.
    all_mm : (S, A)
        With welds left in.
    sigma_mm : (S, A)
        1 σ of ``local_mm`` from noise and the wall's natural roughness; NaN where nothing was seen.
    noise_mm : (S, A)
        Its part from noise alone.
    welds : tuple of slice
        Rows of all-round beads.
    harmonics_mm : (S, 5)
        Of the smooth shape that ``all_mm`` refers to: mean, cos ψ, sin ψ, cos 2ψ, sin 2ψ.
    """

    distance_mm: Float
    azimuth_rad: Float
    radius_mm: float
    local_mm: Float
    all_mm: Float
    sigma_mm: Float
    noise_mm: Float
    welds: tuple[slice, ...]
    harmonics_mm: Float

    def shape_at(self, row: Float, column: Float) -> Float:
        """Return the smooth shape's radius (N,) at fractional rows and columns (N,)."""
        step = float(self.azimuth_rad[1] - self.azimuth_rad[0])
        basis = _basis(self.azimuth_rad[0] + step * column)
        at = np.arange(len(self.harmonics_mm))
        coefficients = np.stack([np.interp(row, at, c) for c in self.harmonics_mm.T], -1)
        return np.asarray((coefficients * basis).sum(-1))

    @property
    def cell_mm(self) -> tuple[float, float]:
        """Size of a cell along and around."""
        along = float(self.distance_mm[1] - self.distance_mm[0])
        return along, float(self.azimuth_rad[1] - self.azimuth_rad[0]) * self.radius_mm

    @property
    def seen(self) -> Mask:
        """(S, A) true where the wall was measured."""
        return np.isfinite(self.sigma_mm)


def smooth_shape_removed(radius_map: RadiusMap, parameters: DefectParameters, known: Mask) -> Relief:
    """Return the relief of a wall; ``known`` (S, A) marks defects that are known and kept out of all fits.

    The slow shape is mean radius and harmonics 1 and 2 (off-centre, oval), each a spline along the pipe
    fitted robustly, so that neither a defect nor a weld pulls it. What a single ring has of these harmonics
    beyond the slow shape is error of motion unless it stands out: then it is a weld. Even there, the first
    harmonic is motion: a ring cannot tell it from the probe's own shift.
    """
    measured = radius_map.radius_mm.astype(float)
    radius = np.where(known, np.nan, measured)
    basis = _basis(radius_map.azimuth_rad)
    step = float(radius_map.distance_mm[1] - radius_map.distance_mm[0])
    coefficients = _ring_harmonics(radius, basis)
    slow = _slow_along(radius_map.distance_mm, coefficients, parameters.smooth_mm)
    deviation = radius - slow @ basis.T
    rings = _ring_harmonics(deviation, basis)
    welds = _weld_rows(deviation, rings[:, 0], step, parameters)
    motion = _interpolated_across(rings, welds, round(2.0 / step))
    beads = _rows(welds, len(rings))[:, None] & np.isfinite(rings)
    shifted = motion.copy()
    shifted[:, 1:3] = np.where(beads, rings, motion)[:, 1:3]
    everything = measured - (slow + shifted) @ basis.T
    local = measured - (slow + np.where(beads, rings, motion)) @ basis.T
    sigma, noise = _spread(local, radius_map)
    mean = float(np.nanmedian(measured))
    return Relief(
        radius_map.distance_mm,
        radius_map.azimuth_rad,
        mean,
        local,
        everything,
        sigma,
        noise,
        welds,
        slow + shifted,
    )  # fmt: skip


def _basis(azimuth_rad: Float) -> Float:
    """Return (A, 5): 1, cos ψ, sin ψ, cos 2ψ, sin 2ψ."""
    waves = [f(m * azimuth_rad) for m in range(1, _HARMONICS + 1) for f in (np.cos, np.sin)]
    return np.stack([np.ones_like(azimuth_rad), *waves], -1)


def _ring_harmonics(radius: Float, basis: Float) -> Float:
    """Return (S, 5) harmonics of every row by a redescending fit; NaN for rows seen to less than a half."""
    radius, basis = _sectors(radius), _sectors(basis.T).T
    seen = np.isfinite(radius)
    usable = seen.mean(1) >= 0.5
    out = np.full((len(radius), basis.shape[1]), np.nan)
    values, weight = np.where(seen, radius, 0.0)[usable], seen[usable]
    found = np.zeros((len(values), basis.shape[1]))
    found[:, 0] = _row_median(radius[usable])
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
    for _ in range(12):
        residual = np.where(weight, values - found @ basis.T, np.nan)
        scale = _MAD * _row_median(np.abs(residual))
        u = np.nan_to_num(residual / (_TUKEY * np.maximum(scale, 1e-6))[:, None], nan=2.0)
        w = np.where(np.abs(u) < 1, (1 - u * u) ** 2, 0.0)
        normal = (w @ products).reshape(-1, basis.shape[1], basis.shape[1])
        normal += 1e-6 * np.eye(basis.shape[1])
        found = np.linalg.solve(normal, ((w * values) @ basis)[..., None])[..., 0]
    out[usable] = found
    return out


def _sectors(rows: Float) -> Float:
    """Return the means (S, A / k) of k neighbouring columns; NaN where half of them or more was not seen."""
    width = next(k for k in range(max(1, rows.shape[1] // _SECTORS), 0, -1) if rows.shape[1] % k == 0)
    blocks = rows.reshape(len(rows), -1, width)
    count = np.isfinite(blocks).sum(2)
    total = np.nan_to_num(blocks).sum(2)
    return np.asarray(np.where(2 * count > width, total / np.maximum(count, 1), np.nan))


def _row_median(rows: Float) -> Float:
    """Return the median (S,) of every row's seen values; faster than NumPy's where values are missing."""
    ordered = np.sort(rows, 1)
    count = np.isfinite(ordered).sum(1)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    pair = np.take_along_axis(ordered, np.stack([low, np.minimum(high, rows.shape[1] - 1)], -1), 1)
    return np.asarray(pair.mean(1))


def _slow_along(distance_mm: Float, coefficients: Float, smooth_mm: float) -> Float:
    """Return (S, 5) coefficients as robust cubic splines with knots ``smooth_mm`` apart."""
    good = np.isfinite(coefficients[:, 0])
    if good.sum() < 8:
        return np.tile(np.nanmedian(coefficients, 0), (len(coefficients), 1))
    s = distance_mm[good]
    pieces = max(1, int((s[-1] - s[0]) // smooth_mm))
    inner = np.quantile(s, np.linspace(0, 1, pieces + 1)[1:-1])
    knots = np.concatenate([[s[0]] * 4, inner, [s[-1]] * 4])
    splines = [_robust_spline(s, c, knots, smooth_mm) for c in coefficients[good].T]
    return np.stack([b(np.clip(distance_mm, s[0], s[-1])) for b in splines], -1)


def _robust_spline(s: Float, value: Float, knots: Float, smooth_mm: float) -> BSpline:
    window = min(len(s), max(3, round(smooth_mm / max(1e-9, float(np.median(np.diff(s)))))))
    fitted = median_filter(value, window, mode="nearest")
    for _ in range(12):
        residual = value - fitted
        scale = max(_MAD * float(np.median(np.abs(residual))), 1e-6)
        u = residual / (_TUKEY * scale)
        weight = np.where(np.abs(u) < 1, 1 - u * u, 0.0) + 1e-4
        spline = make_lsq_spline(s, value, knots, k=3, w=weight)
        fitted = spline(s)
    return spline


def _weld_rows(
    deviation: Float, mean_mm: Float, step: float, parameters: DefectParameters
) -> tuple[slice, ...]:
    """Return the rows where the whole ring stands off, for no longer than a weld is."""
    mean = gaussian_filter1d(np.nan_to_num(mean_mm), 0.5 / step)
    limit = max(parameters.min_depth_mm / 2, 6 * _MAD * float(np.median(np.abs(mean))))
    out: list[slice] = []
    for sign in (-1.0, 1.0):
        height = sign * mean
        for rows in _runs(height > limit):
            peak = rows.start + int(np.argmax(height[rows]))
            grown = next(
                r for r in _runs(height > max(limit / 2, 0.15 * height[peak])) if r.start <= peak < r.stop
            )
            length = (grown.stop - grown.start) * step
            short = length <= parameters.max_weld_mm and grown not in out
            if short and _all_round(sign * deviation[grown], height[peak]):
                out.append(grown)
    return tuple(sorted(out, key=lambda r: r.start))


def _runs(mask: Mask) -> list[slice]:
    labels, _ = label(mask)
    return [rows for (rows,) in find_objects(labels)]


def _all_round(height: Float, peak: float) -> bool:
    """Tell whether a bead (rows, A) reaches a third of its peak in nine of ten sectors that were seen."""
    seen = np.isfinite(height)
    sectors = [
        (np.where(s, h, 0.0).sum(1) / np.maximum(s.sum(1), 1)).max()
        for h, s in zip(np.array_split(height, 24, axis=1), np.array_split(seen, 24, axis=1), strict=True)
        if s.mean() > 0.5
    ]
    return len(sectors) >= 12 and float(np.mean(np.array(sectors) > peak / 3)) >= 0.9


def _rows(bands: tuple[slice, ...], count: int) -> Mask:
    out = np.zeros(count, bool)
    for band in bands:
        out[band] = True
    return out


def _interpolated_across(rings: Float, bands: tuple[slice, ...], margin: int) -> Float:
    """Return the ring harmonics with welds and unseen rows bridged from both sides."""
    known = np.isfinite(rings[:, 0])
    for band in bands:
        known[max(0, band.start - margin) : band.stop + margin] = False
    if not known.any():
        return np.zeros_like(rings)
    at = np.flatnonzero(known)
    return np.stack([np.interp(np.arange(len(rings)), at, c[at]) for c in rings.T], -1)


def _spread(local: Float, radius_map: RadiusMap) -> tuple[Float, Float]:
    """Return 1 σ of a cell of the relief, and its noise part.

    Natural roughness is what the wall scatters beyond its stated noise. Rows that scatter more than that
    (flanks of a bead, a badly placed ring) are trusted less.
    """
    noise = radius_map.sigma_random_mm.astype(float)
    noise = np.where(np.isfinite(local), noise, np.nan)
    total = (_MAD * float(np.nanmedian(np.abs(local)))) ** 2
    roughness = max(0.0, total - float(np.nanmedian(noise)) ** 2)
    sigma = np.sqrt(noise**2 + roughness)
    measured = np.isfinite(local).any(1)
    excess = np.ones((len(local), 1))
    row = _MAD * _row_median(np.abs(local[measured]))
    excess[measured, 0] = np.maximum(row / np.sqrt(np.nanmean(sigma[measured] ** 2, 1)), 1.0)
    return sigma * excess, noise
