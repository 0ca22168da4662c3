"""A bore that is not as drawn: its error looks like effects that act while the ring is in that bore."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import UnusableError
from stages.diagnose.gauge.fit import Fit, fit
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.scan import span
from stages.diagnose.gauge.search import LEAST_GAIN, Search

# 1 σ, mm, of a bore whose stated tolerance is set aside: far above any error of turning.
_UNKNOWN_MM = 1.0


@dataclass(frozen=True)
class Misdrawn:
    """A bore that explains a run: its place in the gauge's list, error of its radius, and χ² left."""

    section: int
    error_mm: float
    cost: float


def require_bores_as_drawn(searched: Search) -> None:
    """Refuse a run that one bore of another radius than stated explains as well as the effects found.

    Raises
    ------
    UnusableError
        The instrument cannot be judged by such a gauge.
    """
    bore = misdrawn_bore(searched)
    if bore is None:
        return
    run = searched.run
    stated = 2 * float(run.rings.radius_mm[run.rings.section == bore.section][0])
    raise UnusableError(
        "diagnose",
        f"a bore of {stated + 2 * bore.error_mm:.2f} mm where recording.yaml says {stated:g} mm explains the "
        "run as well as any effect. Measure the gauge's bore",
    )


def misdrawn_bore(searched: Search) -> Misdrawn | None:
    """Return the bore whose radius alone explains a run as well as the effects found; None if there is none.

    Hypotheses are compared by χ² and ln n for each free number (G. Schwarz, "Estimating the dimension of a
    model", 1978). χ² counts measurements with correlated errors as one.
    """
    found, nothing = searched.found, searched.nothing
    best = min((_freed(nothing, int(k)) for k in np.unique(searched.run.rings.section)), key=lambda b: b.cost)
    numbers = sum(free_numbers(term, *span(searched.run)) for term in found.terms)
    each = np.log(len(np.unique(found.linearised.equations.cell))) * searched.alike
    explains = nothing.cost - best.cost > LEAST_GAIN * searched.alike
    return best if explains and best.cost < found.cost + each * (numbers - 1) else None


def free_numbers(term: Term, duration_s: float, frame_rate: float) -> int:
    """Return how many numbers of a term are estimated: of a ramp, the time that it refers to is not."""
    return len(term.amplitude) + (len(term.model.shapes(duration_s, frame_rate)) > 1)


def _freed(nothing: Fit, section: int) -> Misdrawn:
    """Return the fit without an effect in which one bore may have any radius."""
    run = nothing.run
    sigma = np.array(np.broadcast_to(run.bore_sigma_mm, nothing.state.bore_mm.shape))
    sigma[section] = _UNKNOWN_MM
    free = fit(replace(run, bore_sigma_mm=sigma), nothing.state, ())
    return Misdrawn(section, float(free.state.bore_mm[section]), free.cost)
