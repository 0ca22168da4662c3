"""A bore that is not as drawn: its error looks like effects that act while the ring is in that bore."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.gauge.fit import Fit, fit
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.scan import span
from stages.diagnose.gauge.search import LEAST_GAIN, Search

# 1 σ, mm, of a bore whose stated tolerance is set aside: far above any error of turning.
_UNKNOWN_MM = 1.0


@dataclass(frozen=True)
class Misdrawn:
    """A bore that explains a run.

    Attributes
    ----------
    stated_mm, error_mm : float
        The radius that recording.yaml states, and how much larger the bore is.
    section : int
        Place in the gauge's list of bores.
    state : Unknowns
        Poses and bores with this radius.
    cost : float
        χ² left.
    """

    stated_mm: float
    error_mm: float
    section: int
    state: Unknowns
    cost: float

    @property
    def words(self) -> str:
        """A sentence that says what to do."""
        measured, stated = 2 * (self.stated_mm + self.error_mm), 2 * self.stated_mm
        return (
            f"A bore of {measured:.2f} mm where recording.yaml says {stated:g} mm explains rings and "
            "fiducials of the gauge run as well as any effect, so that they can show none. Measure the "
            "gauge's bore."
        )


def misdrawn_bore(searched: Search) -> Misdrawn | None:
    """Return the bore whose radius alone explains a run as well as the effects found; None if there is none.

    Hypotheses are compared by χ² and ln n for each free number (G. Schwarz, "Estimating the dimension of a
    model", 1978). χ² counts measurements with correlated errors as one.
    """
    found, nothing = searched.found, searched.nothing
    best = min((_freed(nothing, int(k)) for k in np.unique(searched.run.rings.section)), key=lambda b: b.cost)
    numbers = sum(free_numbers(term, *span(searched.run)) for term in found.terms)
    each = np.log(len(np.unique(found.linearised.equations.cell))) * searched.inflation
    explains = nothing.cost - best.cost > LEAST_GAIN * searched.inflation
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
    stated = float(run.rings.radius_mm[run.rings.section == section][0])
    return Misdrawn(stated, float(free.state.bore_mm[section]), section, free.state, free.cost)
