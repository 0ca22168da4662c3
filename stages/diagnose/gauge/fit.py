"""Joint adjustment of poses, globals and effects under one hypothesis, and evidence about its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.calibrate.gauge.state import ENCODER, OFFSET_SIGMA_MM, Unknowns
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.vocabulary import VOCABULARY
from stages.diagnose.gauge.elimination import (
    FrameSums,
    OwnUnknowns,
    Reduced,
    eliminate_globals,
    eliminate_poses,
)
from stages.diagnose.gauge.equations import ENCODER as ENCODER_ROW
from stages.diagnose.gauge.equations import Part
from stages.diagnose.gauge.linearise import beside, in_courses, linearise
from stages.diagnose.gauge.points import BASELINE_SIGMA_PX, BASELINE_SIZE
from stages.diagnose.gauge.run import GaugeRun, Linearised, Term
from stages.diagnose.gauge.score_spread import score_inflation
from stages.diagnose.inference import INSTRUMENT, Column, Evidence, instrument_information

_CONVERGED = 0.5
# A pose that moves by less than this, mm and rad, is converged: the square of that over the distance of the
# wall is far below a ring's resolution.
_STILL = 1e-3
_PARTS = (1.0, 0.5, 0.2, 0.05)
# A fit is abandoned if it would need more than this factor times the gain promised by its equations: with
# nonlinear laws, a second step gains more than the first one promised. Debt: data/debts.md.
_AT_MOST = 3.0
_ITERATIONS = 8
_DELAY_SIGMA_S = 0.002
_PLACEMENT_SIGMA_MM = 0.05
# Prior 1 σ of an effect in plausible sizes: wide, so that the data determine the size. Debt: data/debts.md.
_WIDE = 100.0


@dataclass(frozen=True)
class Fit:
    """The optimum under one hypothesis.

    Attributes
    ----------
    cost : float
        Weighted sum of squares, including the priors of the stated instrument.
    """

    run: GaugeRun
    state: Unknowns
    terms: tuple[Term, ...]
    cost: float

    @cached_property
    def linearised(self) -> Linearised:
        """The run's equations at the optimum."""
        return linearise(self.run, self.state, self.terms)

    def at(self, run: GaugeRun) -> Linearised:
        """Return the equations, at the optimum, of a run with other weights or fewer measurements."""
        same = run.measures_as(self.run)
        return self.linearised if same else linearise(run, self.state, self.terms)

    @cached_property
    def reduced(self) -> Reduced:
        """The equations with the poses eliminated."""
        return eliminate_poses(self.linearised.equations, self.linearised.motion, len(self.state.T_pc))

    @cached_property
    def of_patterns(self) -> Evidence:
        """Evidence of the run on the terms, and on all patterns without a cause that are not among them."""
        own = {(t.model, t.shape) for t in self.terms}
        return evidence(self.run, self, [p for p in VOCABULARY if p not in own])[0]


def fit(run: GaugeRun, start: Unknowns, terms: Sequence[Term], iterations: int = _ITERATIONS) -> Fit:
    """Minimise over poses, globals and the terms' amplitudes by Gauss-Newton with fixed weights.

    Raises
    ------
    numpy.linalg.LinAlgError
        When something is not determined.
    """
    return _minimised(_at(run, start, tuple(terms)), iterations, np.inf)


def fit_beside(
    found: Fit, model: EffectModel, shape: Shape, iterations: int = _ITERATIONS, worth: float = np.inf
) -> Fit:
    """Return the fit with one more effect, starting at size zero; abandoned where it cannot reach ``worth``.

    Its first equations are those of the previous fit, which are not computed again.
    """
    term = Term(model, shape, np.zeros(len(model.amplitudes)))
    start = Fit(found.run, found.state, (*found.terms, term), np.nan)
    vars(start).update(linearised=beside(found.run, found.state, found.linearised, model, shape))
    return _minimised(_costed(start), iterations, worth)


def _minimised(found: Fit, iterations: int, worth: float) -> Fit:
    """Return the fit after at most ``iterations`` steps, or when no step gains or reaches ``worth``."""
    for _ in range(iterations):
        prior, pull, _ = _prior(found.state, found.terms, found.run)
        information = found.reduced.information + prior
        downhill = found.reduced.right - pull
        step = np.asarray(np.linalg.solve(information, downhill), np.float64)
        promised = float(step @ downhill)
        little = promised < _CONVERGED
        if (little and _still(found)) or found.cost - _AT_MOST * promised > worth:
            break
        # Where only poses are left to move, a shorter step gains no more than a full one.
        better = _shortened(found.run, found, step, _PARTS[:1] if little else _PARTS)
        if better is None and _still(found):
            return found
        if better is None:
            # What a large step of the poses gains is only promised by equations: take it and check.
            found = _at(found.run, *_moved(found, 0.0 * step))
            continue
        gain, found = found.cost - better.cost, better
        if gain < _CONVERGED:
            break
    return found


def _still(found: Fit) -> bool:
    """Return whether the measured poses move so little that their linearisation holds."""
    equations = found.linearised.equations
    measured = np.unique(equations.frame[(equations.kind != ENCODER_ROW) & (equations.weight > 0)])
    return bool(np.abs(found.reduced.pose_step[measured]).max(initial=0.0) < _STILL)


def _shortened(run: GaugeRun, found: Fit, step: Float, parts: Sequence[float]) -> Fit | None:
    """Return the fit after the largest fraction of the step that lowers the cost; None if there is none."""
    for part in parts:
        better = _at(run, *_moved(found, part * step))
        if better.cost < found.cost:
            return better
    return None


def evidence(
    run: GaugeRun, found: Fit, asked: Sequence[tuple[EffectModel, Shape]], parts: Sequence[Part] = (),
    with_spread: bool = True,
) -> tuple[Evidence, ...]:  # fmt: skip
    """Return the run's evidence on the fit's terms and on the effects asked about, together.

    Parameters
    ----------
    parts : sequence of Part
        Each gives evidence of its own after that of the whole run.
    with_spread : bool
        Whether the scores' true scatter is estimated; if not, errors are taken as independent.

    Returns
    -------
    tuple of Evidence
        The whole run's first.
    """
    at = found.at(run)
    sums = FrameSums.of(in_courses(run, found.state, at, asked, with_baseline=True))
    everything = Part(np.ones(len(found.state.T_pc), bool))
    return tuple(_reduced(run, found, asked, sums, p, at.motion, with_spread) for p in (everything, *parts))


def _reduced(
    run: GaugeRun, found: Fit, asked: Sequence[tuple[EffectModel, Shape]], sums: FrameSums, part: Part,
    motion: Rows, with_spread: bool,
) -> Evidence:  # fmt: skip
    """Return the evidence of a part of the run, all but the shared columns eliminated."""
    reduced = sums.reduced(motion, part)
    own = own_unknowns(run, found, sums.equations.size)
    left, misfit = eliminate_globals(reduced, own)
    names, value = kept_columns(found, asked)
    inflation, degrees = np.ones(len(names)), np.full(len(names), np.inf)
    if with_spread:
        stated = found.state.stated
        before = block_diag(np.diag([stated.encoder_scale_sigma**-2.0]), instrument_information(stated))
        equations = sums.equations.of(part).in_full()
        inflation, degrees = score_inflation(equations, reduced, left, own.out, _by_effect(names), before)
    information, right = left.information, left.right
    # From the point of linearisation back to the stated instrument.
    misfit += float(2 * right @ value + value @ information @ value)
    known = np.array([k for k, name in enumerate(names) if name is not None])
    pick = np.ix_(known, known)
    return Evidence(
        tuple(name for name in names if name is not None),
        information[pick],
        (right + information @ value)[known],
        (information * np.outer(inflation, inflation))[pick], misfit,
        degrees[known],
    )  # fmt: skip


def _by_effect(names: Sequence[Column | None]) -> Int:
    """Return a number (K,) for the columns of each effect and shape, −1 for the instrument's."""
    keys = [(c.effect, c.shape) if c is not None and c.effect != INSTRUMENT else None for c in names]
    number = {key: k for k, key in enumerate(dict.fromkeys(k for k in keys if k is not None))}
    return np.array([-1 if key is None else number[key] for key in keys], np.int64)


def own_unknowns(run: GaugeRun, found: Fit, size: int) -> OwnUnknowns:
    """Return the globals of the run alone: offset, delay, bores, fiducials, and the baseline at the end."""
    at = found.state.layout
    prior, pull, value = _prior(found.state, found.terms, run)
    wide = [np.zeros(size) for _ in range(3)]
    for all_of_them, first in zip(wide, (prior.diagonal(), pull, value), strict=True):
        all_of_them[: len(first)] = first
    wide[0][size - BASELINE_SIZE :] = BASELINE_SIGMA_PX**-2
    out = np.r_[1:ENCODER, at.bore, at.marker, size - BASELINE_SIZE : size]
    return OwnUnknowns(out, *(x[out] for x in wide))


def kept_columns(found: Fit, asked: Sequence[tuple[EffectModel, Shape]]) -> tuple[list[Column | None], Float]:
    """Return the kept globals' columns, and their present values, true minus stated."""
    state = found.state
    names: list[Column | None] = [Column(INSTRUMENT, "encoder_scale")]
    value = [state.encoder[0] - 1]
    sigma = np.sqrt(np.diag(state.stated.covariance))
    for name, here, known in zip(state.stated.parameter_names, state.instrument, sigma, strict=True):
        names.append(Column(INSTRUMENT, name) if known > 0 else None)
        value.append(here)
    for t in found.terms:
        names += [Column(t.model.name, a.name, t.shape) for a in t.amplitudes]
        value += list(t.amplitude)
    for model, shape in asked:
        names += [Column(model.name, a.name, shape) for a in model.amplitudes]
    return names, np.pad(value, (0, len(names) - len(value)))


def _at(run: GaugeRun, state: Unknowns, terms: tuple[Term, ...]) -> Fit:
    return _costed(Fit(run, state, terms, np.nan))


def _costed(found: Fit) -> Fit:
    _, pull, value = _prior(found.state, found.terms, found.run)
    # The poses' own step is included in the cost; the remaining step of the globals is below _CONVERGED.
    made = replace(found, cost=found.reduced.misfit + float(value @ pull))
    vars(made).update(linearised=found.linearised, reduced=found.reduced)  # not computed twice
    return made


def _prior(state: Unknowns, terms: Sequence[Term], run: GaugeRun) -> tuple[Float, Float, Float]:
    """Return the information (G, G) of the globals' priors, its product with their values, and these."""
    at = state.layout
    size = at.size + sum(len(t.amplitude) for t in terms)
    information = np.zeros((size, size))
    sigma = np.ones(at.size)
    sigma[:ENCODER] = state.stated.encoder_scale_sigma, OFFSET_SIGMA_MM, _DELAY_SIGMA_S
    sigma[at.bore] = run.bore_sigma_mm
    sigma[at.marker] = _PLACEMENT_SIGMA_MM
    information[: at.size, : at.size] = np.diag(sigma**-2)
    information[at.instrument, at.instrument] = instrument_information(state.stated)
    plausible = [a.plausible for t in terms for a in t.amplitudes]
    wide = np.arange(at.size, size)
    information[wide, wide] = (_WIDE * np.array(plausible)) ** -2.0
    value = np.concatenate(
        [state.encoder - [1.0, state.first_offset_mm, 0.0], state.bore_mm, state.edge_mm.ravel(),
         state.instrument, *[t.amplitude for t in terms]]
    )  # fmt: skip
    return information, information @ value, value


def _moved(found: Fit, step: Float) -> tuple[Unknowns, tuple[Term, ...]]:
    """Return state and terms after a step (G,) of the globals, with the poses following."""
    state, size = found.state, found.state.border_size
    reduced = found.reduced
    poses = reduced.pose_step - reduced.pose_by_global @ step
    moved = replace(
        state.step(np.concatenate([poses, np.zeros((len(poses), 1))], 1), step[:size]),
        T_pc=from_parts(
            state.T_pc[:, :3, :3] @ rotation_from_vector(poses[:, 3:]), state.T_pc[:, :3, 3] + poses[:, :3]
        ),
    )
    terms, first = [], size
    for t in found.terms:
        terms.append(replace(t, amplitude=t.amplitude + step[first : first + len(t.amplitude)]))
        first += len(t.amplitude)
    return moved, tuple(terms)
