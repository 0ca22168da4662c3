"""Error budget of the ring scanner: the paper's Table I and more, analytic and by Monte Carlo.

`error_budget` gives the rows and their sum for a `scan.RingScan`; `design` answers the designer's questions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.adjustment.robust import root_mean_square
from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.budget.scan import (
    LinePhotometry,
    Pose,
    RingScan,
    disturbance_jacobian,
    line_sigma_px,
    radius_by_pixel,
    radius_jacobian,
    without_centre,
)
from pipeline.instrument.budget.sources import (
    DISTURBANCE_NAMES,
    RANDOM_SOURCES,
    Kind,
    Source,
    further_sources,
    stated_sources,
)
from pipeline.instrument.probe import Probe


@dataclass(frozen=True)
class Row:
    """One source's share.

    Attributes
    ----------
    source : Source
    sigma : float
        1 σ in the source's unit (root mean square over azimuth for random sources).
    origin : str
        ``stated`` by the probe, ``given`` by the user, ``typical`` or ``computed`` from the line.
    sigma_mm : mapping of Pose to (A,)
        1 σ of the radius.
    covariance : (k, k)
        Of the source's parameters; empty for random sources.
    shift_px : (A,)
        1 σ of the line's position; empty for systematic sources.
    """

    source: Source
    sigma: float
    origin: str
    sigma_mm: Mapping[Pose, Float]
    covariance: Float = field(repr=False)
    shift_px: Float = field(repr=False)

    def level(self, pose: Pose) -> float:
        """Root mean square over azimuth, mm."""
        return root_mean_square(self.sigma_mm[pose])

    def worst(self, pose: Pose) -> float:
        """Largest over azimuth, mm."""
        return float(self.sigma_mm[pose].max())


@dataclass(frozen=True)
class Budget:
    """All rows of a scan.

    Attributes
    ----------
    scan : RingScan
    rows : tuple of Row
    covariance : (P + E, P + E)
        Of the probe's parameters and the disturbances, correlations included.
    """

    scan: RingScan
    rows: tuple[Row, ...]
    covariance: Float = field(repr=False)

    def total_mm(self, kind: Kind | None, pose: Pose) -> Float:
        """Return the combined 1 σ (A,) of one kind, or of both, with the correlations of the parameters."""
        variance = np.zeros(self.scan.azimuths)
        if kind is not Kind.RANDOM:
            variance = variance + _spread(_jacobian(self.scan)[pose], self.covariance)
        if kind is not Kind.SYSTEMATIC:
            shares = [r.sigma_mm[pose] ** 2 for r in self.rows if r.source.kind is Kind.RANDOM]
            variance = variance + np.sum(shares, 0)
        return np.asarray(np.sqrt(variance))

    def uncorrelated_mm(self, pose: Pose) -> Float:
        """Return the root of the sum of the rows' squares (A,): the total if nothing were correlated."""
        return np.asarray(np.sqrt(np.sum([row.sigma_mm[pose] ** 2 for row in self.rows], 0)))

    def row(self, name: str) -> Row:
        """Return the row of a source."""
        return next(row for row in self.rows if row.source.name == name)


def error_budget(scan: RingScan, given: Mapping[str, float] | None = None) -> Budget:
    """Return the analytic budget of a scan.

    Parameters
    ----------
    scan
        Its probe's covariance gives the stated sources' σ.
    given
        1 σ by source name in the source's unit, instead of the stated or typical one; 0 switches it off.

    Raises
    ------
    InputError
        If a name is not a source or a σ is not a number of at least 0.
    """
    given = {} if given is None else given
    _check(scan.probe, given)
    stated = _stated_covariance(scan.probe, given)
    further = [(s, *_sigma(s, given)) for s in further_sources(scan.probe)]
    names = parameter_names(scan.probe)
    covariance = _embedded(stated, names, scan.probe.parameter_names)
    jacobian = _jacobian(scan)
    rows = [_stated_row(scan, s, covariance, given, jacobian) for s in stated_sources(scan.probe)]
    for source, sigma, origin in further:
        block = _source_covariance(source, sigma)
        covariance = covariance + _embedded(block, names, source.parameters)
        rows.append(_systematic_row(scan, source, sigma, origin, block, jacobian))
    rows += _random_rows(scan, given)
    return Budget(scan, tuple(rows), covariance)


def parameter_names(probe: Probe) -> tuple[str, ...]:
    """Return the names of all parameters that systematic sources change: the probe's, then disturbances."""
    return (*probe.parameter_names, *DISTURBANCE_NAMES)


def _check(probe: Probe, given: Mapping[str, float]) -> None:
    known = [s.name for s in (*stated_sources(probe), *further_sources(probe), *RANDOM_SOURCES)]
    for name, sigma in given.items():
        if name not in known:
            raise InputError("error budget", f"no error source is called {name!r}", expected=", ".join(known))
        if not (math.isfinite(sigma) and sigma >= 0):
            raise InputError(
                "error budget", f"{sigma} is not a valid σ", place=name, expected="a number of at least 0"
            )


def _stated_covariance(probe: Probe, given: Mapping[str, float]) -> Float:
    """Scale the blocks of sources with a given σ; sources without a stated σ use their typical one."""
    covariance = probe.covariance.copy()
    for source in stated_sources(probe):
        index = [probe.parameter_names.index(p) for p in source.parameters]
        now = _shown(source, covariance[np.ix_(index, index)])
        optional = source.table_one == ""
        wanted = given.get(source.name, source.typical if optional and now == 0 else now)
        if now > 0:
            scale = np.ones(len(covariance))
            scale[index] = wanted / now
            covariance = covariance * np.outer(scale, scale)
        elif wanted > 0:
            covariance[np.ix_(index, index)] = _source_covariance(source, wanted)
    return covariance


def _shown(source: Source, block: Float) -> float:
    """Return the σ to show: of the first parameter for distortion, else the root mean square."""
    variance = np.diag(block)
    first = source.name == "radial_distortion" and variance[0] > 0
    size = variance[0] if first else variance.mean()
    return float(np.sqrt(size)) / source.factor


def _source_covariance(source: Source, sigma: float) -> Float:
    """Return (k, k): focal lengths are fully correlated, all other parameters are independent."""
    size = (sigma * source.factor) ** 2
    k = len(source.parameters)
    if source.name in ("focal_scale", "focal_drift"):
        return np.full((k, k), size)
    if source.name == "radial_distortion":
        return np.diag([size] + [0.0] * (k - 1))
    return size * np.eye(k)


def _sigma(source: Source, given: Mapping[str, float]) -> tuple[float, str]:
    return (given[source.name], "given") if source.name in given else (source.typical, "typical")


def _embedded(block: Float, names: tuple[str, ...], members: tuple[str, ...]) -> Float:
    index = [names.index(m) for m in members]
    out = np.zeros((len(names), len(names)))
    out[np.ix_(index, index)] = block
    return out


def _stated_row(
    scan: RingScan,
    source: Source,
    covariance: Float,
    given: Mapping[str, float],
    jacobian: Mapping[Pose, Float],
) -> Row:
    names = parameter_names(scan.probe)
    index = [names.index(p) for p in source.parameters]
    block = covariance[np.ix_(index, index)]
    before = scan.probe.covariance[np.ix_(index, index)]
    origin = (
        "given" if source.name in given else "typical" if np.trace(block) > np.trace(before) else "stated"
    )
    return _systematic_row(scan, source, _shown(source, block), origin, block, jacobian)


def _systematic_row(
    scan: RingScan, source: Source, sigma: float, origin: str, block: Float, jacobian: Mapping[Pose, Float]
) -> Row:
    names = parameter_names(scan.probe)
    index = [names.index(p) for p in source.parameters]
    shares = {pose: np.sqrt(_spread(j[:, index], block)) for pose, j in jacobian.items()}
    return Row(source, sigma, origin, shares, block, np.zeros(0))


def _random_rows(scan: RingScan, given: Mapping[str, float]) -> list[Row]:
    computed = line_sigma_px(scan, LinePhotometry())
    per_px = np.abs(np.einsum("ni,ni->n", radius_by_pixel(scan), scan.line_normals))
    left = without_centre(scan, np.eye(scan.azimuths))
    rows = []
    for source in RANDOM_SOURCES:
        origin = "computed" if source.name in computed else "typical"
        shift = computed.get(source.name, np.full(scan.azimuths, source.typical))
        if source.name in given:
            origin, shift = "given", np.full(scan.azimuths, given[source.name])
        fitted = np.linalg.norm(left * (shift * per_px), axis=-1)
        shares = {Pose.KNOWN: shift * per_px, Pose.FITTED: fitted}
        sigma = root_mean_square(shift)
        rows.append(Row(source, sigma, origin, shares, np.zeros((0, 0)), shift))
    return rows


def _jacobian(scan: RingScan) -> dict[Pose, Float]:
    known = np.concatenate([radius_jacobian(scan), disturbance_jacobian(scan)], -1)
    return {Pose.KNOWN: known, Pose.FITTED: without_centre(scan, known)}


def _spread(jacobian: Float, covariance: Float) -> Float:
    """Return the diagonal of J Σ Jᵀ (A,)."""
    return np.asarray(np.maximum(np.einsum("ai,ij,aj->a", jacobian, covariance, jacobian), 0.0))
