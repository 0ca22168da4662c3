"""The stage sections measures cross-sections: diameters, ovality by each definition, centre, with their 1 σ.

At each station a slab of wall is averaged along the pipe, and a truncated Fourier series about the fitted
centre is its shape. Calliper diameters are read from that series: extremes of raw samples grow with noise.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from pydantic import Field

from pipeline.adjustment.robust import basis_of
from pipeline.arrays import Bool, Float
from pipeline.artefacts.findings import Sections
from pipeline.artefacts.measured import RadiusMap, Wall
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Recording

_DIRECTIONS: Float = np.linspace(0, np.pi, 360, endpoint=False)
# Largest unseen arc, in periods of the highest harmonic: in its middle the series is as certain as one
# sample.
_LONGEST_GAP = 5 / 6
# Ovality is the second harmonic: with fewer there is no section to report.
_LEAST_HARMONICS = 2


class SectionParameters(Parameters):
    """Parameters of the sections."""

    spacing_mm: float = Field(
        5.0, ge=0.5, le=1000.0, description="distance between stations and length of each slab, mm"
    )
    harmonics: int = Field(
        6,
        ge=2,
        le=24,
        description="highest harmonic of the section's smooth shape, even; fewer where an arc was not seen",
    )
    min_coverage: float = Field(
        0.6, ge=0.1, le=1.0, description="least seen fraction of the azimuths for a section to be measured"
    )


@dataclass(frozen=True)
class _Slab:
    """A station's mean radius (A,) with its errors, and the fraction seen.

    They are its variance by noise (A,) and by calibration, and the local 1 σ of a displaced picture.
    """

    radius_mm: Float
    variance_mm2: Float
    calibration_mm2: float
    displaced_mm: float
    coverage: float


@dataclass(frozen=True)
class _Shape:
    """Fourier coefficients (mean; cos m, sin m …) about ``centre`` and their random covariance."""

    centre: Float
    coefficients: Float
    covariance: Float


def measure_sections(
    recording: Recording, wall: Wall, parameters: SectionParameters, context: Context
) -> Sections:
    """Measure the cross-section at every station.

    Raises
    ------
    UnusableError
        When no radius was measured at all.
    """
    radius_map = wall.radius_map
    if not np.isfinite(radius_map.radius_mm).any():
        raise UnusableError("sections", "the wall has no measured radius", hint="look at the rings stage")
    stations = _stations(radius_map.distance_mm, parameters.spacing_mm)
    rows = []
    for k, station in enumerate(stations):
        slab = _slab(radius_map, station, parameters.spacing_mm)
        seen = np.isfinite(slab.radius_mm)
        harmonics = _determined_harmonics(seen, parameters.harmonics)
        if seen.mean() >= parameters.min_coverage and harmonics >= _LEAST_HARMONICS:
            shape = _fit_shape(radius_map.azimuth_rad, slab, harmonics)
            rows.append(_measures(station, slab, shape, recording.pipe.nominal_diameter_mm))
        else:
            rows.append(_unmeasured(station, slab.coverage))
        context.progress(k + 1, len(stations))
    table = np.array(rows)
    context.report("sections measured", int(np.isfinite(table[:, 2]).sum()), "stations")
    context.report("rejected: coverage too low", int(np.isnan(table[:, 2]).sum()), "stations")
    return Sections(*table.T)


def _stations(distance_mm: Float, spacing_mm: float) -> Float:
    """Return the centres (K,) of slabs on a grid that is anchored at distance 0."""
    first, last = distance_mm[0] / spacing_mm, distance_mm[-1] / spacing_mm
    centres = (np.arange(np.floor(first), np.ceil(last) + 1) + 0.5) * spacing_mm
    inside = (centres > distance_mm[0]) & (centres < distance_mm[-1])
    return np.asarray(centres[inside] if inside.any() else np.array([distance_mm.mean()]))


def _slab(radius_map: RadiusMap, station: float, spacing_mm: float) -> _Slab:
    step = float(np.diff(radius_map.distance_mm[:2])[0]) if len(radius_map.distance_mm) > 1 else spacing_mm
    half = max(spacing_mm, step) / 2
    rows = slice(*np.searchsorted(radius_map.distance_mm, [station - half, station + half]))
    radius = radius_map.radius_mm[rows].astype(float)
    random = radius_map.sigma_random_mm[rows].astype(float) ** 2
    seen = np.isfinite(radius) & np.isfinite(random)
    count = seen.sum(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(seen, radius, 0).sum(0) / count
        variance = np.where(seen, random, 0).sum(0) / count**2
    excess = radius_map.common_variance(rows)[seen]
    calibration = float(excess.mean()) if excess.size else np.nan
    displaced = float(radius_map.displaced_in(rows).max(initial=0.0))
    return _Slab(mean, variance, calibration, displaced, float(seen.mean()))


def _determined_harmonics(seen: Bool, most: int) -> int:
    """Return how many harmonics, at most ``most``, the ``seen`` azimuths (A,) determine.

    The longest unseen arc decides.
    """
    edges = np.flatnonzero(np.concatenate([seen, seen]))
    if not edges.size:
        return 0
    gap = int(np.diff(edges).max(initial=1)) - 1
    return most if gap == 0 else min(most, int(_LONGEST_GAP * len(seen) / gap))


def _fit_shape(azimuth_rad: Float, slab: _Slab, harmonics: int) -> _Shape:
    """Fit the series about the centre at which its first harmonic vanishes."""
    seen = np.isfinite(slab.radius_mm)
    psi, radius = azimuth_rad[seen], slab.radius_mm[seen]
    centre = np.zeros(2)
    for _ in range(4):
        xy = radius[:, None] * np.stack([np.cos(psi), np.sin(psi)], -1) - centre
        about = np.hypot(*xy.T)
        basis = basis_of(np.arctan2(xy[:, 1], xy[:, 0]), harmonics)
        coefficients = np.linalg.lstsq(basis, about, rcond=None)[0]
        centre = centre + coefficients[1:3]
    residual = np.full(len(azimuth_rad), np.nan)
    residual[seen] = about - basis @ coefficients
    spread = max(float(np.var(residual[seen])), float(slab.variance_mm2[seen].mean()))
    covariance = np.asarray(spread * _correlation_length(residual) * np.linalg.inv(basis.T @ basis), float)
    return _Shape(centre, np.asarray(coefficients, float), covariance)


def _correlation_length(residual: Float) -> float:
    """Return how many neighbouring samples share one independent value: 1 + 2 Σ ρ_k up to its first zero."""
    filled = np.nan_to_num(residual)
    power = np.abs(np.fft.rfft(filled)) ** 2
    rho = np.fft.irfft(power, len(filled))
    if rho[0] <= 0:
        return 1.0
    rho = rho[1 : len(rho) // 4] / rho[0]
    negative = np.flatnonzero(rho <= 0)
    return float(1 + 2 * rho[: negative[0] if negative.size else None].sum())


def _measures(station: float, slab: _Slab, shape: _Shape, nominal_mm: float) -> Float:
    """Return one row of `Sections`, in the order of its fields."""
    theta, cov = shape.coefficients, shape.covariance
    calibration = 2 * np.sqrt(slab.calibration_mm2)
    # Both ends of a diameter, and of the two diameters of an oval, whose difference is four amplitudes.
    ends_mm, four_mm = np.sqrt(2) * slab.displaced_mm, 2 * slab.displaced_mm
    calliper = _calliper_basis((len(theta) - 1) // 2)
    diameter = calliper @ theta
    high, low = calliper[np.argmax(diameter)], calliper[np.argmin(diameter)]
    middle = calliper.mean(0)
    mean, most, least = middle @ theta, high @ theta, low @ theta
    far = max((high, low), key=lambda g: abs(float((g - middle) @ theta)))
    span, reach = (high - low) @ theta, abs(float((far - middle) @ theta))
    amplitude = float(np.hypot(*theta[3:5]))
    direction = np.zeros(len(theta))
    direction[3:5] = theta[3:5] / amplitude if amplitude > 0 else np.sqrt(0.5)

    def noise(g: Float) -> float:
        return float(np.sqrt(g @ cov @ g))

    def absolute(g: Float, local_mm: float = 0.0) -> float:
        return float(np.linalg.norm([noise(g), calibration, local_mm]))

    def relative(g: Float, local_mm: float, value: float, base: float, base_sigma: float) -> float:
        return float(np.hypot(np.hypot(noise(g), local_mm) / base, value / base**2 * base_sigma))

    return np.array([
        station, slab.coverage,
        mean, absolute(middle), least, absolute(low, ends_mm), most, absolute(high, ends_mm),
        span / nominal_mm, relative(high - low, four_mm, span, nominal_mm, 0.0),
        span / mean, relative(high - low, four_mm, span, mean, absolute(middle)),
        reach / mean, relative(far - middle, ends_mm, reach, mean, absolute(middle)),
        amplitude, float(np.hypot(noise(direction), four_mm / 4)),
        _DIRECTIONS[np.argmax(diameter)], *shape.centre, np.sqrt(np.trace(cov[1:3, 1:3]) / 2),
    ])  # fmt: skip


def _calliper_basis(harmonics: int) -> Float:
    """Return (360, 1 + 2 harmonics): coefficients to diameter D(ψ) = r(ψ) + r(ψ + π), ψ over half a turn."""
    return basis_of(_DIRECTIONS, harmonics) + basis_of(_DIRECTIONS + np.pi, harmonics)


def _unmeasured(station: float, coverage: float) -> Float:
    row = np.full(len(fields(Sections)), np.nan)
    row[:2] = station, coverage
    return row


SECTIONS = Stage(
    "sections", "4", SectionParameters, measure_sections, "diameters, ovality and centre at every station"
)
