"""The wall's relief: its radius without smooth shape, motion error of single rings, and all-round beads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from pipeline.adjustment.robust import MAD_TO_SIGMA, basis_of, ring_harmonics, robust_spread, row_median
from pipeline.arrays import Bool, Float, runs_of
from pipeline.artefacts.measured import RadiusMap
from stages.defects.along import sample, slow_along, stretches
from stages.defects.parameters import DefectParameters

# Beads up to this length, such as most welds, stand out of a running median over twice as much (chosen).
_SHORT_MM = 10.0


@dataclass(frozen=True)
class Typical:
    """Medians over a wall: 1 σ of a cell of its relief, and the part of it that is noise, mm."""

    sigma_mm: float
    noise_mm: float


@dataclass(frozen=True)
class Relief:
    """Deviation of some rows of a wall from its own smooth shape, mm, positive into the wall.

    Attributes
    ----------
    distance_mm : (S,)
    azimuth_rad : (A,)
    radius_mm : float
        Mean radius of the whole wall.
    local_mm : (S, A)
        Deviation without anything that goes all round: for defects of a part of the circumference.
    all_mm : (S, A)
        Deviation with welds left in.
    noise_mm : (S, A)
        1 σ of single cells from noise and the wall's natural roughness; NaN where nothing was seen.
    sigma_mm : (S, A)
        1 σ of ``local_mm``: ``noise_mm``, and more in rows that scatter more about the smooth shape, or whose
        picture is displaced.
    welds : tuple of slice
        Rows of all-round beads of the whole wall, counted from the first row here.
    harmonics_mm : (S, 5)
        The smooth shape that ``all_mm`` is relative to: mean, cos ψ, sin ψ, cos 2ψ, sin 2ψ.
    typical : Typical
    """

    distance_mm: Float
    azimuth_rad: Float
    radius_mm: float
    local_mm: Float
    all_mm: Float
    noise_mm: Float
    sigma_mm: Float
    welds: tuple[slice, ...]
    harmonics_mm: Float
    typical: Typical

    def shape_at(self, row: Float, column: Float) -> Float:
        """Return the smooth shape's radius (N,), mm, at fractional rows and columns (N,)."""
        step = float(self.azimuth_rad[1] - self.azimuth_rad[0])
        basis = basis_of(self.azimuth_rad[0] + step * column)
        at = np.arange(len(self.harmonics_mm))
        coefficients = np.stack([np.interp(row, at, c) for c in self.harmonics_mm.T], -1)
        return np.asarray((coefficients * basis).sum(-1))

    @property
    def cell_mm(self) -> tuple[float, float]:
        """Size of a cell along and around the pipe, mm."""
        along = float(self.distance_mm[1] - self.distance_mm[0])
        return along, float(self.azimuth_rad[1] - self.azimuth_rad[0]) * self.radius_mm

    @property
    def seen(self) -> Bool:
        """(S, A) true where the wall was measured."""
        return np.isfinite(self.sigma_mm)


@dataclass(frozen=True)
class WallRelief:
    """The relief of a whole wall; its rows are computed when they are asked for.

    Attributes
    ----------
    radius_map : RadiusMap
    radius_mm : float
        Mean radius.
    local_shape_mm, whole_shape_mm : (S, 5)
        Harmonics that are subtracted for `Relief.local_mm` and for `Relief.all_mm`.
    welds : tuple of slice
        Rows of all-round beads.
    roughness_mm2 : float
        Variance of the wall's natural roughness.
    typical : Typical
    sampled : tuple of slice
        Rows from which medians over the wall are taken.
    """

    radius_map: RadiusMap
    radius_mm: float
    local_shape_mm: Float
    whole_shape_mm: Float
    welds: tuple[slice, ...]
    roughness_mm2: float
    typical: Typical
    sampled: tuple[slice, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the map."""
        return len(self.radius_map.distance_mm), len(self.radius_map.azimuth_rad)

    @property
    def cell_mm(self) -> tuple[float, float]:
        """Size of a cell along and around the pipe, mm."""
        s, psi = self.radius_map.distance_mm, self.radius_map.azimuth_rad
        return float(s[1] - s[0]), float(psi[1] - psi[0]) * self.radius_mm

    def rows_in(self, length_mm: float) -> int:
        """Return how many rows cover a length."""
        return int(np.ceil(length_mm / self.cell_mm[0]))

    def rows(self, rows: slice) -> Relief:
        """Return the relief of some rows."""
        measured = self.radius_map.radius_mm[rows].astype(float)
        basis = basis_of(self.radius_map.azimuth_rad)
        local = measured - self.local_shape_mm[rows] @ basis.T
        noise = _noise(self.radius_map, rows, local, self.roughness_mm2)
        # What displaces the picture makes rows scatter as well: it counts once.
        sigma = np.maximum(_sigma(local, noise), self.radius_map.displaced_in(rows)[:, None])
        welds = tuple(slice(w.start - rows.start, w.stop - rows.start) for w in self.welds)
        return Relief(
            self.radius_map.distance_mm[rows], self.radius_map.azimuth_rad, self.radius_mm,
            local, measured - self.whole_shape_mm[rows] @ basis.T,
            noise, sigma, welds, self.whole_shape_mm[rows], self.typical,
        )  # fmt: skip


def smooth_shape_removed(
    radius_map: RadiusMap, parameters: DefectParameters, known: Bool | None = None
) -> WallRelief:
    """Return the relief of a wall; cells that ``known`` (S, A) marks as defects are left out of all fits.

    The smooth shape is the mean radius and harmonics 1 and 2 (off-centre, oval), each a robust spline along
    the pipe that neither a defect nor a weld pulls. What a single ring has of these harmonics beyond the
    spline is motion error, unless it stands out: then it is a weld. The first harmonic is motion even there:
    a ring cannot distinguish it from a shift of the probe.
    """
    basis = basis_of(radius_map.azimuth_rad)
    step = float(radius_map.distance_mm[1] - radius_map.distance_mm[0])

    def radius(rows: slice) -> Float:
        measured = radius_map.radius_mm[rows].astype(float)
        return measured if known is None else np.where(known[rows], np.nan, measured)

    slow = slow_along(radius_map.distance_mm, _by_ring(radius, radius_map), parameters.smooth_mm)

    def deviation(rows: slice) -> Float:
        return np.asarray(radius(rows) - slow[rows] @ basis.T)

    rings = _by_ring(deviation, radius_map)
    welds = weld_rows(deviation, rings[:, 0], slow[:, 0], step, parameters)
    motion = _interpolated_across(rings, slow, welds, round(2.0 / step))
    beads = _in_bands(welds, len(rings))[:, None] & np.isfinite(rings)
    shifted = motion.copy()
    shifted[:, 1:3] = np.where(beads, rings, motion)[:, 1:3]
    local = slow + np.where(beads, rings, motion)
    return _with_spread(radius_map, local, slow + shifted, welds, sample(np.isfinite(rings[:, 0])))


def _by_ring(rows_of: Callable[[slice], Float], radius_map: RadiusMap) -> Float:
    """Return the harmonics (S, 5), mm, of every row that ``rows_of`` gives."""
    basis = basis_of(radius_map.azimuth_rad)
    parts = [ring_harmonics(rows_of(s.own), basis) for s in stretches(len(radius_map.distance_mm))]
    return np.concatenate(parts)


def _with_spread(
    radius_map: RadiusMap, local: Float, whole: Float, welds: tuple[slice, ...], sampled: tuple[slice, ...]
) -> WallRelief:
    """Return the relief with its spread; roughness is the wall's scatter beyond its stated noise."""
    basis = basis_of(radius_map.azimuth_rad)
    measured = [radius_map.radius_mm[rows].astype(float) for rows in sampled]
    rest = [m - local[rows] @ basis.T for m, rows in zip(measured, sampled, strict=True)]
    noise_mm = _median([_noise(radius_map, *each) for each in zip(sampled, rest, strict=True)])
    roughness = max(0.0, (MAD_TO_SIGMA * _median([np.abs(r) for r in rest])) ** 2 - noise_mm**2)
    each = zip(sampled, rest, strict=True)
    sigma_mm = _median([_sigma(r, _noise(radius_map, rows, r, roughness)) for rows, r in each])
    typical = Typical(sigma_mm, noise_mm)
    return WallRelief(radius_map, _median(measured), local, whole, welds, roughness, typical, sampled)


def _median(parts: list[Float]) -> float:
    return float(np.nanmedian(np.concatenate(parts)))


def _noise(radius_map: RadiusMap, rows: slice, local: Float, roughness_mm2: float = 0.0) -> Float:
    """Return 1 σ of cells, mm, from their measured noise and the wall's roughness."""
    noise = np.sqrt(radius_map.sigma_random_mm[rows].astype(float) ** 2 + roughness_mm2)
    return np.where(np.isfinite(local), noise, np.nan)


def _sigma(local: Float, noise: Float) -> Float:
    """Return 1 σ of cells, mm; larger in rows that scatter more: a bead's flanks, a misplaced ring."""
    measured = np.isfinite(local).any(1)
    excess = np.ones((len(local), 1))
    row = MAD_TO_SIGMA * row_median(np.abs(local[measured]))
    excess[measured, 0] = np.maximum(row / np.sqrt(np.nanmean(noise[measured] ** 2, 1)), 1.0)
    return np.asarray(noise * excess)


def _in_bands(bands: tuple[slice, ...], count: int) -> Bool:
    out = np.zeros(count, bool)
    for band in bands:
        out[band] = True
    return out


def _interpolated_across(rings: Float, slow: Float, bands: tuple[slice, ...], margin: int) -> Float:
    """Return the ring harmonics (S, 5), relative to ``slow``, straight across welds and unseen rows.

    Near a step of the bore the slow shape bends where the wall does not: their sum is straight.
    """
    known = np.isfinite(rings[:, 0])
    for band in bands:
        known[max(0, band.start - margin) : band.stop + margin] = False
    if not known.any():
        return np.zeros_like(rings)
    at = np.flatnonzero(known)
    rows = np.clip(np.arange(len(rings)), at[0], at[-1])
    return np.stack([np.interp(rows, at, c[at]) for c in (slow + rings).T], -1) - slow[rows]


def weld_rows(
    deviation: Callable[[slice], Float], mean_mm: Float, slow_mm: Float, step: float,
    parameters: DefectParameters,
) -> tuple[slice, ...]:  # fmt: skip
    """Return the rows of all beads that go round the pipe.

    ``deviation`` gives some rows (rows, A) of the wall's deviation from its slow shape, ``mean_mm`` (S,) the
    mean of each row of it, ``slow_mm`` (S,) the slow shape's mean, ``step`` the spacing of rows; all mm.

    The slow shape is too low before a step of the bore and too high behind it, or the other way round, and
    all beads of the pipe would have to be higher than that. A running median keeps a step as it is: beads are
    looked for above the slow shape, and short ones above the running median as well.
    """
    mean = gaussian_filter1d(np.nan_to_num(mean_mm), 0.5 / step)
    median = median_filter(slow_mm + mean, 2 * round(_SHORT_MM / step) + 1, mode="nearest") - slow_mm
    out: list[slice] = []
    for base in (np.zeros_like(mean), median):
        beads = _beads(deviation, mean, base, step, parameters)
        out += [bead for bead in beads if not any(bead.start < b.stop and b.start < bead.stop for b in out)]
    return tuple(sorted(out, key=lambda r: r.start))


def _beads(
    deviation: Callable[[slice], Float], mean: Float, base: Float, step: float, parameters: DefectParameters
) -> list[slice]:
    """Return the rows of beads by which the smoothed ``mean`` (S,) of rows stands out of a ``base`` (S,)."""
    limit = max(parameters.min_depth_mm / 2, 6 * robust_spread(mean - base))
    longest = int(parameters.max_weld_mm / step)
    out: list[slice] = []
    for sign in (-1.0, 1.0):
        height = sign * (mean - base)
        for rows in runs_of(height > limit):
            peak = rows.start + int(np.argmax(height[rows]))
            bead = _run_around(height, peak, max(limit / 2, 0.15 * height[peak]), longest)
            if bead is None or bead in out:
                continue
            if _all_round(sign * (deviation(bead) - base[bead][:, None]), height[peak]):
                out.append(bead)
    return out


def _run_around(height: Float, peak: int, level: float, longest: int) -> slice | None:
    """Return the rows about ``peak`` that are above ``level``; None where there are more than ``longest``."""
    first = max(0, peak - longest - 1)
    near = height[first : peak + longest + 2] > level
    bead = next(r for r in runs_of(near) if r.start <= peak - first < r.stop)
    return slice(bead.start + first, bead.stop + first) if bead.stop - bead.start <= longest else None


def _all_round(height: Float, peak: float) -> bool:
    """Return whether a bead (rows, A) reaches a third of its peak in nine of ten measured sectors."""
    seen = np.isfinite(height)
    sectors = [
        (np.where(s, h, 0.0).sum(1) / np.maximum(s.sum(1), 1)).max()
        for h, s in zip(np.array_split(height, 24, axis=1), np.array_split(seen, 24, axis=1), strict=True)
        if s.mean() > 0.5
    ]
    # Nine of ten (chosen): one sector in ten may be missing from a real weld.
    return len(sectors) >= 12 and float(np.mean(np.array(sectors) > peak / 3)) >= 0.9
