"""Evidence of left-out physics from the difference between motion and encoder, and from the motion itself."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from pipeline.arrays import Bool, Float
from pipeline.files.codec import NOT_STORED
from pipeline.physics.catalogue import effect
from pipeline.recording.base import Encoder, Recording
from stages.diagnose.agreement import Agreement
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.travel.events import is_found, with_events
from stages.diagnose.travel.left_over import LeftOver, left_over
from stages.diagnose.travel.lines import Line, find_lines
from stages.diagnose.travel.model import TravelFit, second_predictions
from stages.diagnose.travel.sight import Sight, quantum_mm
from stages.diagnose.travel.solve import DELAY, OFFSET, PLAY, SCALE, SMOOTH
from stages.diagnose.travel.steps import StepFound, steps_found

_LEAST_FRAMES = 16
_DETECTED = 5.0
_INSEPARABLE = 0.95
# 1 σ of a frame's time stamp, which may refer to the exposure's start, middle or end. Debt: data/debts.md.
_STAMP_SIGMA_S = 1e-3
# At a reversal a counter may be wrong by one count, which is not play of the wheel. Debt: data/debts.md.
_QUANTUM_SHARE = 0.5
_REPORTED = 1e-3
_SELDOM = 0.02
_SHORTEST_MM = 20.0
# Logarithm of odds that are decisive in any case.
_SURE_OF = 50.0


@dataclass(frozen=True)
class TravelEstimate:
    """One smooth effect between encoder and visual distance.

    Attributes
    ----------
    effect, quantity : str
        Names of the catalogue.
    value, sigma : float
        With all effects fitted together; σ is infinite where this motion does not determine it.
    stated_sigma : float
        1 σ of the stated instrument's uncertainty.
    p_value : float
        Of a value as far beyond the stated uncertainty.
    detectable : float
        Least size that would stand out here (5 σ), from motion and noise alone.
    alike : tuple of (str, float)
        Effects that this motion cannot distinguish from it, with the correlation of the estimates.
    agreements : tuple of Agreement
        Whether disjoint parts of the travel agree.
    where : tuple of int or None
        First and last index of the `Sight` between which it adds to the readings.
    other_courses : float
        Likelihood of unnamed courses in its place relative to it, on average.
    taken_off : float
        Part of the whole that another effect makes, so that ``value`` is the rest: set when recordings are
        compared, and never stored.
    """

    effect: str
    quantity: str
    value: float
    sigma: float
    stated_sigma: float
    p_value: float
    detectable: float
    alike: tuple[tuple[str, float], ...]
    agreements: tuple[Agreement, ...] = ()
    where: tuple[int, int] | None = None
    other_courses: float = 0.0
    taken_off: float = field(default=0.0, metadata=NOT_STORED)

    @property
    def size_sigma(self) -> float:
        """1 σ of the size: includes errors of stamps and counts, but not what is stated of the wheel."""
        return self.sigma if self.effect == SMOOTH[SCALE] else float(np.hypot(self.sigma, self.stated_sigma))

    @property
    def statement(self) -> str:
        """Return a sentence that states the effect with its size."""
        return LIBRARY[self.effect].statement((), np.array([self.value]))


@dataclass(frozen=True)
class TravelEvidence:
    """Motion against encoder, and lines in the motion's spectrum, of one recording.

    Attributes
    ----------
    source : str
        ``gauge`` or ``field``.
    slips : tuple of StepFound
        Steps that only a slip explains.
    doubtful : tuple of StepFound
        Steps that a stray picture or missing frames would also explain, as `StepFound.doubt` says.
    fit : TravelFit or None
        None without a usable encoder.
    shortcomings : tuple of str
        What this recording cannot show, and why.
    unexplained : LeftOver or None
        A difference between motion and encoder that no effect of the encoder explains.
    """

    source: str
    estimates: tuple[TravelEstimate, ...]
    slips: tuple[StepFound, ...]
    doubtful: tuple[StepFound, ...]
    lines: tuple[Line, ...]
    fit: TravelFit | None
    shortcomings: tuple[str, ...]
    unexplained: LeftOver | None = None

    @property
    def least_p(self) -> float:
        """Smallest p-value of what shows between motion and encoder, or in the motion; 1 if nothing does."""
        smooth = (e.p_value for e in self.estimates if e.p_value < _REPORTED)
        steps = (s.p_value for s in (*self.slips, *self.doubtful))
        left = () if self.unexplained is None else (self.unexplained.p_value,)
        return min((*smooth, *steps, *(line.p_value for line in self.lines), *left), default=1.0)

    @property
    def unsettled(self) -> tuple[StepFound, ...]:
        """The doubtful steps that are more than chance."""
        return tuple(s for s in self.doubtful if is_found(s.p_value))

    @property
    def fits_p(self) -> float:
        """Probability that noise makes the residual of all effects and steps."""
        return self.fit.fits_p if self.fit is not None else 1.0

    def estimate(self, name: str) -> TravelEstimate | None:
        """Return the estimate of an effect, or None."""
        return next((e for e in self.estimates if e.effect == name), None)


def travel_evidence(
    source: str, recording: Recording, sight: Sight, T_pc: Float, scale_sigma_stated: float,
    shown: Bool | None = None, without: Collection[str] = (),
) -> TravelEvidence:  # fmt: skip
    """Compare the visual distance with the encoder, and search for lines in the sideways motion.

    Parameters
    ----------
    source
        ``gauge`` or ``field``.
    sight
        From poses estimated without the encoder.
    T_pc : (K, 4, 4)
        Poses of the recording's frames from the first to the last of ``sight``, both included.
    scale_sigma_stated
        Relative 1 σ of the encoder's scale as stated.
    shown : (K,) bool, optional
        Whether a frame's own picture determines the camera's sideways position; without it, all do.
    without
        Effects that are treated as unknown.
    """
    first = int(np.searchsorted(recording.frames.frame, sight.frame[0])) if len(sight.frame) else 0
    span = slice(first, first + len(T_pc))
    lit = np.isin(recording.frames.illumination[span], ("led", "both"))
    lines = find_lines(recording.frames.time_s[span], T_pc[:, :2, 3], lit, shown)
    missing = _shortcomings(source, recording, sight)
    encoder = recording.encoder
    if encoder is None or len(encoder.time_s) < 2 or len(sight.frame) < _LEAST_FRAMES:
        return TravelEvidence(source, (), (), (), lines, None, missing)
    sight = _covered(sight, encoder)
    if len(sight.frame) < _LEAST_FRAMES:
        few = f"The encoder of the {_in_words(source)} covers too few of its frames to be compared."
        return TravelEvidence(source, (), (), (), lines, None, (*missing, few))
    fit = with_events(sight, encoder, tuple(without))
    steps = steps_found(fit, encoder)
    slips = tuple(s for s in steps if not s.rivals)
    doubtful = tuple(s for s in steps if s.rivals)
    estimates = _estimates(source, fit, scale_sigma_stated, quantum_mm(encoder))
    missing = (*missing, *_blind([e for e in estimates if e.effect not in without], sight))
    left = left_over(fit, steps, quantum_mm(encoder))
    return TravelEvidence(source, estimates, slips, doubtful, lines, fit, missing, left)


def _covered(sight: Sight, encoder: Encoder) -> Sight:
    """Return the frames within the encoder's time, with half a frame more at the ends."""
    slack = sight.frame_time_s / 2
    return sight.select(
        (sight.time_s >= encoder.time_s[0] - slack) & (sight.time_s <= encoder.time_s[-1] + slack)
    )


def _estimates(
    source: str, fit: TravelFit, scale_sigma_stated: float, count_mm: float
) -> tuple[TravelEstimate, ...]:
    turning = _QUANTUM_SHARE * max(fit.noise.white_mm, count_mm)
    stated = {SCALE: scale_sigma_stated, DELAY: _STAMP_SIGMA_S, PLAY: turning}
    # In a pipe of unknown size, the pictures have the scale that the laser's baseline gives them.
    more = {SCALE: (("baseline", 1.0),)} if source == "field" else {}
    return tuple(_estimate(fit, k, s, (*_alike(fit, k), *more.get(k, ()))) for k, s in stated.items())


def _estimate(
    fit: TravelFit, k: int, stated_sigma: float, alike: tuple[tuple[str, float], ...]
) -> TravelEstimate:
    """Return the estimate of one smooth effect."""
    name, sigma, value = SMOOTH[k], float(fit.sigma[k]), float(fit.values[k])
    total = float(np.hypot(sigma, stated_sigma))
    # A size that no encoder can have is not a finding: the speed was too uniform to determine it.
    known = np.isfinite(total) and LIBRARY[name].possible((), np.array([value]))
    p = float(2 * norm.sf(abs(value) / total)) if known else 1.0
    # The counter has an independent error at each reversal; errors of wheel and time stamps are constant
    # over the run.
    again = second_predictions(fit, k, stated_sigma if k == PLAY else 0.0) if p < _REPORTED else ()
    return TravelEstimate(
        name, effect(name).quantities[0].name, value, sigma, stated_sigma, p, _DETECTED * total, alike, again,
        _where(fit.columns[:, k]), _other_courses(fit, k) if known and p < _REPORTED else 0.0,
    )  # fmt: skip


def _alike(fit: TravelFit, k: int) -> tuple[tuple[str, float], ...]:
    """Return the smooth effects that this motion does not distinguish from one, with the correlations."""
    others = (j for j in (SCALE, DELAY, PLAY) if j != k and not (fit.told_apart and {j, k} == {DELAY, PLAY}))
    known = (j for j in others if np.isfinite(fit.sigma[[j, k]]).all())
    each = ((SMOOTH[j], float(fit.covariance[k, j] / (fit.sigma[k] * fit.sigma[j]))) for j in known)
    return tuple((name, correlation) for name, correlation in each if abs(correlation) > _INSEPARABLE)


def _other_courses(fit: TravelFit, column: int) -> float:
    """Return the likelihood of unnamed courses in a smooth effect's place, relative to it.

    They depend on the distance, its square, the speed, its absolute value, or its sign; the effect's own is
    left out. The other effects that were found stay free; χ² is divided by what the fit leaves in units of
    the noise.
    """
    sight, speed = fit.sight, np.gradient(fit.sight.distance_mm, fit.sight.time_s)
    way = (sight.distance_mm - sight.distance_mm.mean()) / max(float(np.ptp(sight.distance_mm)), 1e-9)
    courses = {SCALE: way, DELAY: speed, PLAY: sight.direction, 4: way**2, 5: np.abs(speed)}
    others = [fit.columns[:, column], *(c for k, c in courses.items() if k != column)]
    found = [k for k in range(len(fit.values)) if k != column and (k == OFFSET or fit.values[k] != 0)]
    gain = fit.with_columns(fit.columns[:, found]).gain(np.stack(others, 1))[1] / max(fit.left_over, 1.0)
    return float(np.mean(np.exp(np.clip((gain[1:] - gain[0]) / 2, -_SURE_OF, _SURE_OF))))


def _where(column: Float) -> tuple[int, int] | None:
    """Return the first and the last index between which a column has nearly all of its effect."""
    moved = np.cumsum(np.abs(np.diff(column)))
    if not len(moved) or moved[-1] <= 0:
        return None
    low, high = np.searchsorted(moved, np.array([_SELDOM, 1 - _SELDOM]) * moved[-1])
    return int(low), int(high) + 1


def _shortcomings(source: str, recording: Recording, sight: Sight) -> tuple[str, ...]:
    out, source = [], _in_words(source)
    if recording.encoder is None:
        out.append(f"The {source} has no encoder: its scale, slips, play and delay are not visible.")
    if len(sight.frame) < _LEAST_FRAMES:
        out.append(
            f"Only {len(sight.frame)} frames of the {source} show where the camera is along the pipe: motion "
            "and encoder cannot be compared."
        )
    elif sight.path_mm[-1] < _SHORTEST_MM:
        out.append(
            f"The probe moves by only {sight.path_mm[-1]:.1f} mm in the {source}: errors that grow with "
            "distance or speed are not visible."
        )
    return tuple(out)


def _in_words(source: str) -> str:
    return source.replace("field", "inspection").replace("gauge", "gauge run")


def _blind(estimates: Sequence[TravelEstimate], sight: Sight) -> tuple[str, ...]:
    """Return sentences on effects that this motion does not determine, or determines only together."""
    out = []
    for e in estimates:
        if not np.isfinite(e.sigma):
            why = "" if sight.reverses or e.effect != "encoder_backlash" else ": the probe never turns back"
            out.append(f"The motion of the probe does not show {e.effect.replace('_', ' ')}{why}.")
        for other, correlation in e.alike:
            pair = f"{e.effect} and {other}".replace("_", " ")
            out.append(f"In this motion {pair} look alike (correlation {correlation:+.2f}).")
    return tuple(out)
