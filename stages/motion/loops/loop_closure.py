"""Loop closure: where the probe passes wall again, measures and removes the drift since the first time.

Distance and roll are measured by registering unrolled frames. Position across the pipe and direction are
measured by the pipe's axis, which the rings determine well in every window. The differences are distributed
over the chain of windows (`pose_graph`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Context
from stages.motion.loops.loop_geometry import LoopEnds, PipeFrames
from stages.motion.loops.pose_graph import Closures, conditioned, contradicted_places, corrected
from stages.motion.loops.revisits import Passage, Revisit, WallFeatures, choose_revisits, widened
from stages.motion.loops.strip_registration import ExpectedShift, Registration, Verdict, register
from stages.motion.parameters import MotionParameters
from stages.motion.rings import CORRELATED_FRAMES
from stages.motion.tracking.overlap import StoredStrip
from stages.motion.tracking.strips import Strip, StripGrid
from stages.motion.windows.error_chain import ErrorChain, ErrorSums
from stages.motion.windows.submap_joining import JoinedRun

_LEAST_PROBABILITY = 1e-6
"""A revisit is rejected if a deviation as large as its own from the prediction of all others has p < 10⁻⁶."""
_REACH_SIGMA = 5.0
_LEAST_REACH_PX = 4.0
"""Shifts are searched up to so many σ of their prediction, and some strip samples more for its rounding."""
_DISTANCE, _ROLL = 2, 5
_ACROSS = (0, 1, 3, 4)
"""Components of a closure from texture (along z and about z of the section) and from the axes."""


class View(Protocol):
    """Unrolls frames to strips of the wall."""

    @property
    def grid(self) -> StripGrid:
        """Sampling of the strips."""

    def strips(self, place: Int, T_pc: Float) -> Iterator[Strip | None]:
        """Yield frames (n,), ascending, unrolled from poses (n, 4, 4) in the straightened pipe."""


@dataclass(frozen=True)
class LoopReport:
    """Outcome of closing loops.

    Attributes
    ----------
    revisits : tuple of Revisit
        Where the wall was compared.
    verdicts : tuple of Verdict
        The outcome at each.
    closed : tuple of bool
        Whether the loop was closed there.
    moved_mm : float
        Largest change of a camera's position.
    """

    revisits: tuple[Revisit, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    closed: tuple[bool, ...] = ()
    moved_mm: float = 0.0

    def report(self, context: Context) -> None:
        """Report how many loops were closed, and why others were not."""
        context.report("places where the wall was compared with an earlier pass", len(self.revisits), "")
        if not self.revisits:
            return
        at_weld = sum(t and r.at_weld for t, r in zip(self.closed, self.revisits, strict=True))
        context.report("loops closed there", sum(self.closed), "")
        context.report("loops closed at welds or joints", at_weld, "")
        for verdict, count in Counter(self.verdicts).items():
            if verdict is not Verdict.SAME:
                context.report(f"loops not closed: {verdict.value}", count, "")
        context.report("largest change of position by closing loops", self.moved_mm, "mm")


def close_loops(
    joined: JoinedRun,
    passage: Passage,
    features: Callable[[Passage], WallFeatures],
    view: View,
    parameters: MotionParameters,
    scratch: Scratch,
) -> tuple[JoinedRun, LoopReport]:
    """Return the run with its loops closed, unchanged where none is, and a report.

    Parameters
    ----------
    joined
    passage
        Frames that saw the wall.
    features
        Returns features by which the wall is recognised; called only if some wall was passed again.
    view
    parameters
    scratch
        Storage for strips of earlier passes until the later ones are compared.
    """
    pairs = passage.seen_again(parameters.max_track_frames)
    if not len(pairs) or not parameters.most_loops:
        return joined, LoopReport()
    spacing_mm, most = parameters.loop_spacing_mm, parameters.most_loops
    chosen = choose_revisits(passage, pairs, features(passage), spacing_mm, most)
    ends = LoopEnds.of(chosen, joined)
    by_error = ends.by_error(joined)
    predictor = ShiftPredictor(_shift_covariance(joined.chain, by_error, view.grid))
    reach_mm = [predictor.predict(n).reach[0] * view.grid.step_mm for n in range(len(chosen))]
    revisits = [widened(r, passage, far) for r, far in zip(chosen, reach_mm, strict=True)]
    registered = _registered(revisits, predictor, joined, view, parameters, scratch)
    closures = _closures(by_error, ends, registered, view.grid, parameters)
    closed, verdicts = _judged(joined.chain, closures, registered)
    if not any(closed):
        return joined, LoopReport(tuple(revisits), verdicts, closed)
    found = corrected(joined, conditioned(joined.chain, closures.at(np.flatnonzero(closed))))
    moved_mm = float(np.linalg.norm(found.T_pc[:, :3, 3] - joined.T_pc[:, :3, 3], axis=1).max())
    return found, LoopReport(tuple(revisits), verdicts, closed, moved_mm)


@dataclass
class ShiftPredictor:
    """Predicts the shift of the wall at each revisit from the revisits already registered.

    Drift grows with the distance travelled between two frames. With every registered revisit, the range
    searched at the next one stays small, so that other wall is hardly ever taken for the right one. The
    prediction is the conditional mean of a Gaussian.

    Attributes
    ----------
    covariance : (2 M, 2 M)
        Prior covariance of the shifts, with rows and columns alternating.
    known : list of int
        Registered revisits.
    shift, variance : list of (2,)
        Shifts measured there, and their variances.
    """

    covariance: Float
    known: list[int] = field(default_factory=list)
    shift: list[Float] = field(default_factory=list)
    variance: list[Float] = field(default_factory=list)

    def predict(self, revisit: int) -> ExpectedShift:
        """Return the shift expected at a revisit."""
        mine, theirs = _both_shifts([revisit]), _both_shifts(self.known)
        mean: Float = np.zeros(2)
        covariance = self.covariance[np.ix_(mine, mine)]
        if self.known:
            own = self.covariance[np.ix_(theirs, theirs)] + np.diag(np.concatenate(self.variance))
            with_mine = self.covariance[np.ix_(theirs, mine)]
            gain = np.asarray(np.linalg.solve(own, with_mine).T, float)
            mean, covariance = gain @ np.concatenate(self.shift), covariance - gain @ with_mine
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return ExpectedShift(mean, np.ceil(_REACH_SIGMA * sigma + _LEAST_REACH_PX))

    def learn(self, revisit: int, found: Registration) -> None:
        """Store the registration of a revisit."""
        if found.verdict is Verdict.SAME:
            self.known.append(revisit)
            self.shift.append(found.shift)
            self.variance.append(found.sigma**2)


def _both_shifts(revisits: Sequence[int]) -> Int:
    """Return the rows of both shifts of revisits."""
    return (2 * np.array(revisits, np.int64)[:, None] + np.arange(2)).ravel()


def _shift_covariance(chain: ErrorChain, by_error: ErrorSums, grid: StripGrid) -> Float:
    """Return the covariance (2 M, 2 M) of the shifts, strip samples, before any loop is closed."""
    along = (6 * np.arange(by_error.columns // 6)[:, None] + np.array([_DISTANCE, _ROLL])).ravel()
    return chain.covariance_of(by_error.select(along, np.tile(1 / _per_sample(grid), len(along) // 2)))


def _per_sample(grid: StripGrid) -> Float:
    """Return mm per row and rad per column."""
    return np.array([grid.step_mm, 2 * np.pi / grid.columns])


def _registered(
    revisits: Sequence[Revisit],
    predictor: ShiftPredictor,
    joined: JoinedRun,
    view: View,
    parameters: MotionParameters,
    scratch: Scratch,
) -> list[Registration]:
    """Return the registration of each revisit's strips; one earlier strip at a time is in memory."""
    frames = np.unique([f for r in revisits for f in (*r.earlier, r.later)])
    earlier = {f for r in revisits for f in r.earlier}
    stored = scratch.spool(np.float16, (view.grid.rows, view.grid.columns))
    rows: dict[int, tuple[int, int]] = {}
    found: dict[int, Registration] = {}
    poses = PipeFrames.of(joined, frames).T_pc
    for frame, strip in zip(frames.tolist(), view.strips(frames, poses), strict=True):
        if strip is None:
            continue
        for n in (n for n, r in enumerate(revisits) if r.later == frame):
            known = (rows[f] for f in revisits[n].earlier if f in rows)
            strips = (StoredStrip(first, stored.part(k, k + 1)[0].astype(np.float32)) for k, first in known)
            found[n] = register(strips, strip, predictor.predict(n), parameters)
            predictor.learn(n, found[n])
        if frame in earlier:
            rows[frame] = (stored.count, strip.first_row)
            stored.append(StoredStrip.of(strip).contrast[None])
    return [found.get(n, Registration.refused(Verdict.UNREADABLE)) for n in range(len(revisits))]


def _closures(
    by_error: ErrorSums,
    ends: LoopEnds,
    registered: Sequence[Registration],
    grid: StripGrid,
    parameters: MotionParameters,
) -> Closures:
    """Return the closures of all revisits whose two frames show the same wall."""
    residual, sigma = ends.axis_difference(), np.tile(_axis_sigma(parameters), (len(registered), 1))
    along = [_DISTANCE, _ROLL]
    residual[:, along] = [r.shift for r in registered] * _per_sample(grid)
    sigma[:, along] = [r.sigma for r in registered] * _per_sample(grid)
    use = np.tile(np.array([r.verdict is Verdict.SAME for r in registered])[:, None], 6)
    # One window has one axis: there is nothing to compare across the pipe.
    use[:, _ACROSS] &= (ends.here.window != ends.there.window)[:, None]
    which = np.flatnonzero(use.ravel())
    seen = by_error.select(which, np.ones(len(which)))
    return Closures(seen, residual.ravel()[which], sigma.ravel()[which], which // 6)


def _axis_sigma(parameters: MotionParameters) -> Float:
    """Return 1 σ (6,) of the difference of two windows' axes at a place, by the rings alone.

    The centre of a ring of B bins errs by √(2/B) of a bin's σ; the direction is that of two centres a knot
    apart. Distance and roll are not known from rings.
    """
    bin_mm = np.sqrt(CORRELATED_FRAMES) * parameters.surface_sigma_mm
    across = np.sqrt(2.0) * bin_mm * np.sqrt(2 / parameters.ring_bins)
    lean = np.sqrt(2.0) * across / parameters.axis_knot_mm
    return np.array([across, across, np.inf, lean, lean, np.inf])


def _judged(
    chain: ErrorChain, closures: Closures, registered: Sequence[Registration]
) -> tuple[tuple[bool, ...], tuple[Verdict, ...]]:
    """Return which loops are closed, and every revisit's verdict.

    If at least as many revisits contradict the others as agree, it is unknown which are wrong: none is
    closed.
    """
    verdicts = [r.verdict for r in registered]
    wrong: set[int] = set()
    if closures.place.size:
        wrong = contradicted_places(closures.residual_covariance(chain), closures, _LEAST_PROBABILITY)
    for place in wrong:
        verdicts[place] = Verdict.CONTRADICTED
    same = sum(v is Verdict.SAME for v in verdicts)
    closed = tuple(v is Verdict.SAME and same > len(wrong) for v in verdicts)
    return closed, tuple(verdicts)
