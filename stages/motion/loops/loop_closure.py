"""Loops closed: where the probe passes a wall again, what it measured the first time is measured once more.

Distance and roll come from the texture of unrolled frames; sideways and in direction the pipe itself is the
measure, for rings place it well in every window. What closures show is distributed over the chain of windows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Context
from stages.motion.loops.closing import closed
from stages.motion.loops.foresight import Foresight
from stages.motion.loops.pipe_frames import PipeFrames, pipe_frames
from stages.motion.loops.revisits import Passage, Place, Signs, choose_places, widened
from stages.motion.loops.strip_registration import Comparison, Piece, Verdict, compare
from stages.motion.parameters import MotionParameters
from stages.motion.rings import CORRELATED_FRAMES
from stages.motion.tracking.strips import Strip, StripGrid
from stages.motion.windows.error_chain import Chain, Closures, ErrorSums, astray, beside
from stages.motion.windows.submap_joining import Joined, Laid, chain_of, lay

_LEAST_PROBABILITY = 1e-6
_DISTANCE, _ROLL = 2, 5
_ASIDE = (0, 1, 3, 4)


class View(Protocol):
    """What shows the wall, unrolled."""

    @property
    def grid(self) -> StripGrid:
        """Sampling of the strips."""

    def strips(self, place: Int, T_pc: Float) -> Iterator[Strip | None]:
        """Yield frames (n,), ascending, unrolled from poses (n, 4, 4) in the straightened pipe."""


@dataclass(frozen=True)
class Loops:
    """How closing loops went.

    Attributes
    ----------
    places : tuple of Place
        Where the wall was compared.
    verdicts : tuple of Verdict
        What came of it at each.
    taken : tuple of bool
        Whether the loop was closed there.
    moved_mm : float
        Largest change of a camera's position.
    """

    places: tuple[Place, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    taken: tuple[bool, ...] = ()
    moved_mm: float = 0.0

    def report(self, context: Context) -> None:
        """Report what closing loops came to."""
        context.report("places where the wall was compared with what was seen before", len(self.places), "")
        if not self.places:
            return
        at_weld = sum(t and p.at_weld for t, p in zip(self.taken, self.places, strict=True))
        context.report("loops closed there", sum(self.taken), "")
        context.report("loops closed at welds or joints", at_weld, "")
        for verdict, count in Counter(self.verdicts).items():
            if verdict is not Verdict.SAME:
                context.report(f"loops not closed: {verdict.value}", count, "")
        context.report("largest change of position by closing loops", self.moved_mm, "mm")


def close_loops(
    joined: Joined,
    passage: Passage,
    signs: Callable[[Passage], Signs],
    view: View,
    parameters: MotionParameters,
    scratch: Scratch,
) -> tuple[Joined, Loops]:
    """Return the run with its loops closed, and how that went; as it was where none is closed.

    Parameters
    ----------
    joined
    passage
        Which frames saw the wall.
    signs
        Tells what makes the wall easy to recognise; asked only where some wall was passed again.
    view
    parameters
    scratch
        Where strips of the earlier passes wait for those of the later.
    """
    pairs = passage.seen_again(parameters.max_track_frames)
    if not len(pairs) or not parameters.most_loops:
        return joined, Loops()
    at = choose_places(passage, pairs, signs(passage), parameters.loop_spacing_mm, parameters.most_loops)
    laid = lay(joined.submaps)
    chain = chain_of(laid, joined.settled)
    ends = _Ends.of(at, laid, joined)
    by_error = ends.by_error(joined, chain)
    foresight = Foresight(_spread_px(chain, by_error, view.grid))
    reach_mm = [foresight.of(n).reach[0] * view.grid.step_mm for n in range(len(at))]
    places = [widened(p, passage, far) for p, far in zip(at, reach_mm, strict=True)]
    compared = _compared(places, foresight, laid, joined, view, parameters, scratch)
    closures = _closures(by_error, ends, compared, view.grid, parameters)
    taken, verdicts = _judged(chain, closures, compared)
    if not any(taken):
        return joined, Loops(tuple(places), verdicts, taken)
    found = closed(joined, laid, chain, chain.conditioned(closures.at(np.flatnonzero(taken))))
    moved_mm = float(np.linalg.norm(found.T_pc[:, :3, 3] - joined.T_pc[:, :3, 3], axis=1).max())
    return found, Loops(tuple(places), verdicts, taken, moved_mm)


@dataclass(frozen=True)
class _Ends:
    """The two ends of M loops: frames and where they are in the pipe."""

    earlier: Int
    later: Int
    there: PipeFrames
    here: PipeFrames

    @staticmethod
    def of(places: Sequence[Place], laid: Sequence[Laid], joined: Joined) -> _Ends:
        earlier, later = np.array([(p.earlier[0], p.later) for p in places]).T
        there, here = (pipe_frames(laid, joined, frame) for frame in (earlier, later))
        return _Ends(earlier, later, there, here)

    def by_error(self, joined: Joined, chain: Chain) -> ErrorSums:
        """Return how errors at the chain's frames enter the difference of both ends, 6 M sums.

        Six of each place: along x, y and z of its section, mm, and turns about them, rad.
        """
        at, places = chain.at, len(self.earlier)
        knots, weights = [], []
        for frame, view, sign in ((self.later, self.here, 1.0), (self.earlier, self.there, -1.0)):
            seen = sign * _by_error(frame, view, joined)
            left, right, share = beside(frame, at)
            for knot, part in ((left, 1 - share), (right, share)):
                knots.append(np.repeat(knot, 6))
                weights.append((part[:, None, None] * seen).reshape(-1, 6))
        column = np.tile(np.arange(6 * places), len(knots))
        return ErrorSums.of(np.concatenate(knots), column, np.concatenate(weights), 6 * places)

    def aside(self) -> Float:
        """Return by how much (M, 6) the axis of the later window lies off that of the earlier one."""
        section = self.there.section_o
        shift = np.einsum("nji,nj->ni", section, self.here.axis_o - self.there.axis_o)
        lean = np.einsum("nji,nj->ni", section, self.here.section_o[..., 2])
        zero = np.zeros(len(shift))
        return np.stack([shift[:, 0], shift[:, 1], zero, -lean[:, 1], lean[:, 0], zero], -1)


def _by_error(frame: Int, view: PipeFrames, joined: Joined) -> Float:
    """Return how errors at frames (n,) move them along and about the axes of their sections, (n, 6, 6)."""
    back = np.swapaxes(view.section_o, 1, 2)
    seen = np.zeros((len(frame), 6, 6))
    seen[:, :3, :3], seen[:, 3:, 3:] = back, back @ joined.T_pc[frame, :3, :3]
    return seen


def _spread_px(chain: Chain, by_error: ErrorSums, grid: StripGrid) -> Float:
    """Return the covariance (2 M, 2 M) of the shifts before any loop is closed."""
    along = (6 * np.arange(by_error.columns // 6)[:, None] + np.array([_DISTANCE, _ROLL])).ravel()
    return chain.covariance_of(by_error.some(along, np.tile(1 / _per_px(grid), len(along) // 2)))


def _per_px(grid: StripGrid) -> Float:
    """Return mm per row and rad per column."""
    return np.array([grid.step_mm, 2 * np.pi / grid.columns])


def _compared(
    places: Sequence[Place],
    foresight: Foresight,
    laid: Sequence[Laid],
    joined: Joined,
    view: View,
    parameters: MotionParameters,
    scratch: Scratch,
) -> list[Comparison]:
    """Return what comparing the wall says at each place; of earlier strips no more than one is in memory."""
    frames = np.unique([f for p in places for f in (*p.earlier, p.later)])
    earlier = {f for p in places for f in p.earlier}
    kept = scratch.spool(np.float16, (view.grid.rows, view.grid.columns))
    rows: dict[int, tuple[int, int]] = {}
    found: dict[int, Comparison] = {}
    poses = pipe_frames(laid, joined, frames).T_pc
    for frame, strip in zip(frames.tolist(), view.strips(frames, poses), strict=True):
        if strip is None:
            continue
        for n in (n for n, p in enumerate(places) if p.later == frame):
            known = (rows[f] for f in places[n].earlier if f in rows)
            pieces = (Piece(first, kept.part(k, k + 1)[0].astype(np.float32)) for k, first in known)
            found[n] = compare(pieces, strip, foresight.of(n), parameters)
            foresight.learn(n, found[n])
        if frame in earlier:
            rows[frame] = (kept.count, strip.first_row)
            kept.append(Piece.of(strip).contrast[None])
    return [found.get(n, Comparison.refused(Verdict.UNREAD)) for n in range(len(places))]


def _closures(
    by_error: ErrorSums,
    ends: _Ends,
    compared: Sequence[Comparison],
    grid: StripGrid,
    parameters: MotionParameters,
) -> Closures:
    """Return what all places show that have the same wall in both frames."""
    residual, sigma = ends.aside(), np.tile(_axis_sigma(parameters), (len(compared), 1))
    along = [_DISTANCE, _ROLL]
    residual[:, along] = [c.shift for c in compared] * _per_px(grid)
    sigma[:, along] = [c.sigma for c in compared] * _per_px(grid)
    use = np.tile(np.array([c.verdict is Verdict.SAME for c in compared])[:, None], 6)
    # One window has one axis: there is nothing to compare sideways.
    use[:, _ASIDE] &= (ends.here.window != ends.there.window)[:, None]
    which = np.flatnonzero(use.ravel())
    seen = by_error.some(which, np.ones(len(which)))
    return Closures(seen, residual.ravel()[which], sigma.ravel()[which], which // 6)


def _axis_sigma(parameters: MotionParameters) -> Float:
    """Return 1 σ (6,) of the difference of two windows' axes at a place, by the rings alone.

    The centre of a ring of B bins errs by √(2/B) of a bin's σ; the direction is that of two centres a knot
    apart. Distance and roll are not known from rings.
    """
    bin_mm = np.sqrt(CORRELATED_FRAMES) * parameters.surface_sigma_mm
    aside = np.sqrt(2.0) * bin_mm * np.sqrt(2 / parameters.ring_bins)
    lean = np.sqrt(2.0) * aside / parameters.axis_knot_mm
    return np.array([aside, aside, np.inf, lean, lean, np.inf])


def _judged(
    chain: Chain, closures: Closures, compared: Sequence[Comparison]
) -> tuple[tuple[bool, ...], tuple[Verdict, ...]]:
    """Return which places are closed, and every place's verdict.

    Where as many contradict the rest as do not, nobody can tell which are wrong: none is closed.
    """
    verdicts = [c.verdict for c in compared]
    out = astray(chain.spread(closures), closures, _LEAST_PROBABILITY) if closures.place.size else set()
    for place in out:
        verdicts[place] = Verdict.CONTRADICTED
    same = sum(v is Verdict.SAME for v in verdicts)
    taken = tuple(v is Verdict.SAME and same > len(out) for v in verdicts)
    return taken, tuple(verdicts)
