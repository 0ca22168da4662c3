"""Examine a gauge run: find effects in rings and fiducials, judge them against rivals, and confirm them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Progress, unheard
from pipeline.physics.catalogue import EFFECTS
from pipeline.physics.effect import Channel, CourseKind, FixedTo
from stages.calibrate.gauge import MeasuredRun
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import SEARCHED, with_courses
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.gauge.bores import Misdrawn, misdrawn_bore
from stages.diagnose.gauge.confirm import Sized, confirmations, sizes_of
from stages.diagnose.gauge.feasible import ability, feasibility
from stages.diagnose.gauge.fit import fit
from stages.diagnose.gauge.formula import ADEQUATE, patterns_by_chance, swings
from stages.diagnose.gauge.heldout import fit_quality
from stages.diagnose.gauge.hypotheses import Judged, judged_of, regimes_of
from stages.diagnose.gauge.judge import Verdicts, judge
from stages.diagnose.gauge.run import GaugeRun, Term, pattern_of
from stages.diagnose.gauge.search import Search, prepare, search
from stages.diagnose.gauge.sets import believed
from stages.diagnose.gauge.unknown_laws import Unknown, excess_exponent, odds_of_unknown_laws
from stages.diagnose.inference import DETECTED, Stated, stated_belief
from stages.diagnose.result import Confirmation, Feasible, FitQuality, Location

# A gauge is straight and round: effects of the pipe's own shape are not tested.
OF_A_PIPE = frozenset({"ovality", "pipe_bend"})
# Parts of an examination: preparation, search, judgement.
_PARTS = 3
# The expected number by chance goes up to 8, where the joint p-value of all patterns is 1, and is uniform
# below that in sound runs: nearly all tests resemble the joint one. Rare scores resemble each other less, so
# that numbers below a few tenths are more frequent by `_RARE`: fitted to 144 sound runs (`bench_diagnosis run
# FILE --mode nulls --first 95000 --count 144`): .35 of them per unit lie below .1, .17 below .5, .12 below 4.
_MOST_EXPECTED, _RARE, _RARE_BELOW = 8.0, 0.14, 0.5
# Although nothing was found, something is unexplained if the part of the residual that repeats on other wall
# has more than this many times the variance of noise. Codecs keep a part of a line's error at its place in
# the image from picture to picture, which counts as repeating: sound runs come to 1.00 times the noise in
# all, wavering rows to 2.2.
_REPEATS = 1.0
# Number of sound runs that were counted, none of which passed that limit: 10 at ring level and 5 rendered
# ones, of .93 to 1.02 noise floors where the limit is 1.41. If all are alike, the next is the largest with
# probability 1/16; how seldom it passes the limit is not known. Debt: data/debts.md.
_SOUND = 15
_NOT_ASKED = (
    "The gauge run is too short to predict one part of it from the others: whether it has an error that "
    "repeats at one place of the image was not tested."
)
# Location of a residual that repeats at one place of the image.
_OF_IMAGE = Location(str(Channel.RING), str(FixedTo.CAMERA), None)


def chance_of(expected: float) -> float:
    """Return the probability that in a sound run no more scores as large are ``expected`` by chance."""
    rare = _RARE * np.exp(-expected / _RARE_BELOW)
    return float(min(expected * (1 / _MOST_EXPECTED + rare), 1.0))


def location_of(run: GaugeRun, judged: Judged, stated: Stated, ratio: float) -> Location | None:
    """Return where the first term shows, with its measured radial exponent; χ² is divided by ``ratio``."""
    if not judged.fit.terms:
        return None
    term = judged.fit.terms[0]
    fixed_to, time, harmonic = pattern_of(term)
    rings = judged.fit.linearised.rings
    distance = rings.distance_mm if rings.distance_mm is not None else np.zeros(1)
    return Location(
        "ring", fixed_to, time, harmonic, _exponent(run, judged, term, stated, ratio),
        frames=(int(run.rings.frame.min()), int(run.rings.frame.max())),
        distance_mm=(float(np.nanmin(distance)), float(np.nanmax(distance))), azimuth_deg=(-180.0, 180.0),
    )  # fmt: skip


def _exponent(
    run: GaugeRun, judged: Judged, term: Term, stated: Stated, ratio: float
) -> tuple[float, float] | None:
    """Return d ln |δr| / d ln r with 1 σ: the law's own plus what rings show beyond it."""
    own = _own_exponent(term)
    if own is None:
        return None
    excess, sigma = excess_exponent(run, judged, term, stated, ratio)
    return own + excess, sigma


def _own_exponent(term: Term) -> float | None:
    """Return the law's own exponent."""
    if isinstance(term.model, Nameless):
        return term.model.radial_exponent
    known = EFFECTS.get(term.model.law)
    return known.radial_exponent if known is not None else None


@dataclass(frozen=True)
class Examined:
    """What rings and fiducials of a gauge run show.

    Attributes
    ----------
    verdicts : Verdicts or None
        None when nothing beyond the stated instrument was found.
    confirmed : tuple of tuple of Confirmation
        For each term of the likeliest hypothesis.
    sizes : tuple of Sized
        The same terms' amplitudes with their covariances.
    feasibility : tuple of Feasible
        Detectable size of each effect, computed before any residual was used.
    unknown_laws : tuple of Unknown
        For each of the same terms, odds of unknown laws and courses relative to its name.
    patterns_by_chance : float
        Expected number of fits by patterns without a cause that are as good, when nothing is hidden.
    misdrawn : Misdrawn or None
        A bore that is not as drawn and explains the run as well as any effect; then nothing else was judged.
    """

    searched: Search
    verdicts: Verdicts | None
    confirmed: tuple[tuple[Confirmation, ...], ...]
    feasibility: tuple[Feasible, ...]
    location: Location | None = None
    quality: FitQuality | None = None
    sizes: tuple[Sized, ...] = ()
    unknown_laws: tuple[Unknown, ...] = ()
    patterns_by_chance: float = 1.0
    misdrawn: Misdrawn | None = None

    @property
    def expected(self) -> float:
        """Expected number of scores as large, among all that are tested, when nothing is hidden."""
        return 2 * min(self.searched.by_chance, self.patterns_by_chance)

    @property
    def global_p(self) -> float:
        """Probability of this when nothing is hidden, by the library or by patterns without a cause.

        Of what repeats although neither was found, no more is known than what sound runs show.
        """
        by_search = chance_of(self.expected)
        return min(by_search, 1 / (_SOUND + 1)) if self.repeats else by_search

    @property
    def repeats(self) -> bool:
        """Whether nothing was found, but the residual repeats at one place of the image on other wall."""
        known = self.quality if self.best is None else None
        return known is not None and bool(known.heldout_after**2 > (1 + _REPEATS) * known.noise_floor**2)

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """What could not be asked of a run in which nothing was found, as sentences."""
        known = self.quality if self.best is None else None
        asked = known is None or not np.isnan([known.heldout_after, known.noise_floor]).any()
        return () if asked else (_NOT_ASKED,)

    @property
    def best(self) -> Judged | None:
        """The likeliest hypothesis, if anything was found."""
        return self.verdicts.judged[0] if self.verdicts is not None else None


def examine(
    run: MeasuredRun, library: Mapping[str, EffectModel], probe: Probe,
    courses: tuple[CourseKind, ...] = SEARCHED, progress: Progress = unheard,
) -> Examined:  # fmt: skip
    """Search a gauge run for left-out effects, each law also with each of ``courses``.

    Raises
    ------
    UnusableError
        When the run does not determine its own poses.
    """
    library = {name: model for name, model in library.items() if name not in OF_A_PIPE}
    try:
        # More threads gain nothing on blocks this small, and stall on a busy machine.
        with threadpool_limits(1):
            return _examined(run, library, stated_belief(probe), courses, progress)
    except np.linalg.LinAlgError as error:
        raise UnusableError("diagnose", f"the gauge run does not determine its poses ({error})") from error


def _examined(
    run: MeasuredRun, library: Mapping[str, EffectModel], stated: Stated, courses: tuple[CourseKind, ...],
    progress: Progress,
) -> Examined:  # fmt: skip
    # The watch of the run, which all fits share, reports the parts that are done.
    done = [0]
    measurements, start = prepare(run, lambda: progress(done[0], _PARTS))
    nothing = fit(measurements, start, ())
    table = feasibility(*ability(measurements, nothing, library), library, stated)
    coursed = with_courses(library, courses)
    done[0] = 1
    searched = search(measurements, nothing, coursed, stated)
    done[0] = 2
    # Effects that are not in the library also shift rings and fiducials.
    swung = swings(searched.run, searched.nothing, stated)
    beyond = patterns_by_chance(searched.nothing, stated, swung)
    seen = Examined(searched, None, (), table, patterns_by_chance=beyond)
    if seen.global_p > DETECTED:
        seen = replace(seen, quality=_quality_of_stated(searched, stated))
        return replace(seen, location=_OF_IMAGE if seen.repeats else None)
    bore = misdrawn_bore(searched)
    if bore is not None:
        return replace(seen, misdrawn=bore)
    return _judged(replace(seen, verdicts=judge(searched, coursed, stated, swung)), coursed, stated)


def _quality_of_stated(searched: Search, stated: Stated) -> FitQuality:
    """Return how well the stated instrument, within its uncertainty, predicts the run."""
    run, regimes = searched.run, regimes_of(searched.run)
    nothing = judged_of(run, searched.nothing, regimes, stated, searched.inflation)
    return fit_quality(run, nothing, nothing, regimes, stated)


def _judged(seen: Examined, library: Mapping[str, EffectModel], stated: Stated) -> Examined:
    """Return the findings with confirmations, location and quality of fit."""
    searched, verdicts, best = seen.searched, seen.verdicts, seen.best
    assert verdicts is not None
    assert best is not None
    run, regimes = searched.run, verdicts.regimes
    nothing = next(j for j in verdicts.judged if not j.fit.terms)
    terms, alike = best.library_terms, searched.inflation
    ratio = believed(best.evidence, alike)
    shown = best if terms and verdicts.adequacy >= ADEQUATE else verdicts.formula
    return replace(
        seen,
        confirmed=confirmations(run, best, regimes, terms, stated) if terms else (),
        sizes=sizes_of(run, best, stated, alike) if terms else (),
        unknown_laws=odds_of_unknown_laws(run, best, stated, ratio, library),
        location=location_of(run, shown, stated, ratio),
        quality=fit_quality(run, nothing, shown, regimes, stated),
    )
