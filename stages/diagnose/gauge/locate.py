"""Where a mismatch shows: harmonic, growth with the radius, behaviour in time, and what it is fixed to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Bool
from pipeline.physics.catalogue import EFFECTS
from stages.diagnose.effects.generic import GenericTerm, Moves
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.gauge.confirm import by_bore, partial_of
from stages.diagnose.gauge.fit import evidence
from stages.diagnose.gauge.judge import Judged, Regime
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.inference import Stated
from stages.diagnose.result import Location


def location_of(run: GaugeRun, judged: Judged, regimes: Sequence[Regime], stated: Stated) -> Location | None:
    """Return where the first term shows; its growth with the radius is measured from bore to bore."""
    if not judged.fit.terms:
        return None
    term = judged.fit.terms[0]
    fixed_to, time, harmonic = _pattern(term)
    rings = judged.fit.linearised.rings
    distance = rings.distance_mm if rings.distance_mm is not None else np.zeros(1)
    return Location(
        "ring", fixed_to, time, harmonic, _exponent(run, judged, regimes, term, stated),
        frames=(int(run.rings.frame.min()), int(run.rings.frame.max())),
        distance_mm=(float(np.nanmin(distance)), float(np.nanmax(distance))), azimuth_deg=(-180.0, 180.0),
    )  # fmt: skip


def _pattern(term: Term) -> tuple[str, str, int | None]:
    """Return what the term is fixed to, its behaviour in time and its harmonic."""
    model = term.model
    if isinstance(model, Nameless):
        fixed_to, time, harmonic = model.goes_with(term.shape)
        return str(fixed_to), time, harmonic
    known = EFFECTS[model.name]
    order = int(term.shape[0]) if model.name == "sheet_waviness" else known.harmonic
    return str(known.fixed_to), known.time, order


def _exponent(
    run: GaugeRun, judged: Judged, regimes: Sequence[Regime], term: Term, stated: Stated
) -> tuple[float, float] | None:
    """Return d ln |δr| / d ln r of the residual with 1 σ: the law's own, and how its size drifts with r."""
    bores = by_bore(regimes)
    if len(bores) < 2:
        return None
    _, *each = evidence(run, judged.fit, (), [part for _, part in bores])
    found = [partial_of(w, e, judged, term, stated) for (w, _), e in zip(bores, each, strict=True)]
    radius = [_radius(run, judged, part.frames) for _, part in bores]
    size = float(np.linalg.norm(term.amplitude))
    way = term.amplitude / size
    rows = [
        (np.log(r), float(way @ f.amplitude) / size, float(np.sqrt(way @ f.covariance @ way)) / size)
        for r, f in zip(radius, found, strict=True)
        if f is not None and np.isfinite(f.covariance).all()
    ]
    rows = [row for row in rows if row[1] > 0 and np.isfinite(row[0])]
    own = _own_exponent(judged, term)
    if len(rows) < 2 or own is None:
        return None
    log_r, share, sigma = np.array(rows).T
    weight = (share / sigma) ** 2
    off = log_r - np.average(log_r, weights=weight)
    spread = float(weight @ off**2)
    if spread <= 0:
        return None
    return own + float(weight @ (off * np.log(share))) / spread, float(spread**-0.5)


def _own_exponent(judged: Judged, term: Term) -> float | None:
    """Return the law's own exponent over these bores."""
    if isinstance(term.model, GenericTerm):
        return float(term.model.exponent) if term.model.moves is Moves.LINE else None
    known = EFFECTS.get(term.model.name)
    return known.radial_exponent if known is not None else None


def _radius(run: GaugeRun, judged: Judged, frames: Bool) -> float:
    inside = frames[run.rings.frame]
    return float(np.median(judged.fit.linearised.rings.radius_mm[inside])) if inside.any() else np.nan
