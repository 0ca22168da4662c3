"""Scores of diagnoses: rates with goals and intervals, errors of sizes, calibration, confusion of names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import binomtest

from pipeline.drill.answer import Answer, Concealed, NamedEffect
from pipeline.drill.matching import matched
from pipeline.physics.catalogue import EFFECTS

_95 = 1.959964
_STANDS_OUT = 5.0
SNR = 8.0
_FOUND = ("named", "partly", "class", "unexplained")
_WITH_NAMES = ("named", "partly")
NOTHING = "nothing"
_PROBABILITIES = (0.0, 0.5, 0.8, 0.95, 1.0001)


@dataclass(frozen=True)
class Trial:
    """One recording with what it conceals, and the answer to it.

    Attributes
    ----------
    name : str
    concealed : tuple of Concealed
    answer : Answer
    left_out : tuple of str
        Effects that the library had to do without.
    oracle_snr : float or None
        True size over the 1 σ of an estimator that knows the name; None where only the answer's own
        feasibility is known.
    """

    name: str
    concealed: tuple[Concealed, ...]
    answer: Answer
    left_out: tuple[str, ...] = ()
    oracle_snr: float | None = None

    @property
    def snr(self) -> float | None:
        """SNR of the weakest concealed effect, by the oracle or else by the answer's feasibility."""
        if self.oracle_snr is not None:
            return self.oracle_snr
        each = [_feasible_snr(c, self.answer) for c in self.concealed]
        known = [snr for snr in each if snr is not None]
        return min(known) if known and len(known) == len(each) else None

    @property
    def identifiable(self) -> bool:
        """Whether every concealed effect stands out by 5 σ even with its closest rival free.

        By the answer's feasibility; where that is missing, by the oracle's SNR alone.
        """
        if not self.concealed:
            return False
        left_by_name = {f.name: f.left for f in self.answer.feasibility if f.left is not None}
        left = (left_by_name.get(c.name, 1.0) for c in self.concealed)
        return self.snr is not None and all(self.snr * np.sqrt(share) >= _STANDS_OUT for share in left)

    @property
    def truth(self) -> frozenset[str]:
        """Names of what is concealed."""
        return frozenset(c.name for c in self.concealed)

    @property
    def given(self) -> tuple[NamedEffect, ...]:
        """Effects that the answer names with confidence."""
        return self.answer.effects if self.answer.verdict in _WITH_NAMES else ()

    @property
    def said(self) -> frozenset[str]:
        """Names that the answer gives with confidence."""
        return frozenset(e.name for e in self.given)

    @property
    def right(self) -> list[tuple[NamedEffect, Concealed]]:
        """Names that match a concealed effect, with that effect, one to one."""
        return matched(self.given, self.concealed)

    @property
    def found(self) -> bool:
        """Whether the answer says that physics was left out."""
        return self.answer.verdict in _FOUND

    @property
    def exact(self) -> bool:
        """Whether exactly what is concealed is named, and nothing is said to be left."""
        count = len(self.right)
        return self.answer.verdict == "named" and 0 < count == len(self.given) == len(self.concealed)

    @property
    def misnamed(self) -> bool:
        """Whether a name is wrong, given more often than it is concealed, or has another order."""
        return len(self.right) < len(self.given)

    @property
    def contained(self) -> bool:
        """Whether the answer, name or class, contains all that is concealed."""
        left = self.answer.remainder.members if self.answer.remainder is not None else ()
        return self.truth <= self.said | frozenset((*self.answer.members, *left))


@dataclass(frozen=True)
class Rate:
    """A share of trials with its 95 % interval (E. B. Wilson, 1927)."""

    count: int
    of: int

    @property
    def share(self) -> float:
        """Share; NaN without trials."""
        return self.count / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        if not self.of:
            return 0.0, 1.0
        both = binomtest(self.count, self.of).proportion_ci(method="wilson")
        return float(both.low), float(both.high)


def rate(hits: Iterable[bool]) -> Rate:
    """Return the share of true among ``hits``."""
    listed = list(hits)
    return Rate(sum(listed), len(listed))


@dataclass(frozen=True)
class Figure:
    """One row: a share with its interval, or another number with ``interval`` None and ``of`` its count."""

    name: str
    words: str
    goal: str
    value: float | None
    of: int
    interval: tuple[float, float] | None

    @property
    def count(self) -> int:
        """Number of hits of a share."""
        return round((self.value or 0.0) * self.of)

    @property
    def text(self) -> str:
        """The row in one line."""
        goal = f" (goal {self.goal})" if self.goal else ""
        if self.value is None:
            return f"{self.words}: none to count{goal}"
        if self.interval is None:
            return f"{self.words}: {self.value:+.2f} of {self.of}{goal}"
        low, high = self.interval
        return f"{self.words}: {self.count} of {self.of}, {self.value:.1%} [{low:.1%}, {high:.1%}]{goal}"


# For each share: key, meaning, goal (if any), the group of trials it is taken over, and what counts as a hit.
_RATES: tuple[tuple[str, str, str, str, Callable[[Trial], bool]], ...] = (
    ("false_alarms", "False alarms where nothing is hidden", "0", "null", lambda t: t.found),
    ("detected", "Detected at SNR ≥ 8", "≥ 99 %", "clear", lambda t: t.found),
    ("detected_any", "Detected at any size", "", "known", lambda t: t.found),
    ("located", "Located: channel, what it is fixed to and time behaviour", "≥ 97 %", "found",
     lambda t: all(_located(t, what) for what in ("channel", "fixed_to", "time"))),
    ("channel_right", "Located: channel", "", "found", lambda t: _located(t, "channel")),
    ("fixed_to_right", "Located: what it is fixed to", "", "found", lambda t: _located(t, "fixed_to")),
    ("time_right", "Located: behaviour in time", "", "found", lambda t: _located(t, "time")),
    ("named_identifiable", "Named exactly where identifiable (single effects)", "≥ 95 %",
     "single identifiable", lambda t: t.exact),
    ("named_exactly", "Named exactly (all single effects)", "", "single", lambda t: t.exact),
    ("contained", "Name or class contains the truth (found single effects)", "≥ 99 %", "single found",
     lambda t: t.contained),
    ("misnamed", "Confident wrong name", "≤ 0.5 %", "all", lambda t: t.misnamed),
    ("pairs_named", "Pairs: both named", "≥ 90 %", "pairs", lambda t: t.exact),
    ("pairs_identifiable", "Pairs: both named, where both are identifiable", "", "pairs identifiable",
     lambda t: t.exact),
    ("unknown_owned", "Left out of the library (SNR ≥ 8): unexplained or a class of similar ones", "≥ 90 %",
     "unknown", lambda t: owned(t)),
    ("unknown_misnamed", "Left out of the library (any SNR): confidently misnamed", "≤ 5 %", "left out",
     lambda t: t.misnamed),
)  # fmt: skip


def _sorted(trials: Iterable[Trial]) -> dict[str, list[Trial]]:
    """Return the groups of trials over which shares are taken."""
    listed = list(trials)
    null = [t for t in listed if not t.concealed]
    known = [t for t in listed if t.concealed and not t.truth & set(t.left_out)]
    left_out = [t for t in listed if t.truth & set(t.left_out)]
    single, pairs = ([t for t in known if (len(t.concealed) > 1) == several] for several in (False, True))
    return {
        "all": listed, "null": null, "known": known, "single": single, "pairs": pairs, "left out": left_out,
        # An effect too small even for the oracle is not expected to be called unexplained.
        "unknown": [t for t in left_out if t.snr is None or t.snr >= SNR],
        "clear": [t for t in known if t.snr is not None and t.snr >= SNR],
        "single found": [t for t in single if t.found],
        # An effect of pictures only is not in the catalogue and has no channel.
        "found": [t for t in single if t.found and t.truth <= EFFECTS.keys()],
        "single identifiable": [t for t in single if t.identifiable],
        "pairs identifiable": [t for t in pairs if t.identifiable],
    }  # fmt: skip


def figures(trials: Iterable[Trial]) -> tuple[Figure, ...]:
    """Return the scores of diagnoses against what was concealed."""
    given = _sorted(trials)
    rates = [(name, words, goal, rate(map(hit, given[of]))) for name, words, goal, of, hit in _RATES]
    z = [error for t in given["known"] for error in size_errors(t)]
    rates.append(("size_in_95", "Sizes within their 95 % interval", "93–97 %", rate(abs(x) < _95 for x in z)))
    removed = [r for t in given["known"] if (r := heldout_removed(t.answer)) is not None]
    return (
        *(Figure(name, words, goal, r.share if r.of else None, r.of, r.interval)
          for name, words, goal, r in rates),
        Figure("size_bias_sigma", "Mean error of sizes in σ", "within ±0.2",
               float(np.mean(z)) if z else None, len(z), None),
        Figure("heldout_removed", "Held-out discrepancy above the noise floor removed, median", "≥ 0.97",
               float(np.median(removed)) if removed else None, len(removed), None),
    )  # fmt: skip


def shuffled(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    """Return the trials, each with the answer to another trial that conceals something else.

    A score that stays high does not depend on the answers. Where more than half of the trials conceal the
    same, some keep an answer to the same effect.
    """
    order = sorted(range(len(trials)), key=lambda k: sorted(trials[k].truth))
    apart = max(Counter(t.truth for t in trials).values(), default=0)
    source = dict(zip(order, order[apart:] + order[:apart], strict=True))
    return tuple(replace(t, answer=trials[source[k]].answer) for k, t in enumerate(trials))


def owned(trial: Trial) -> bool:
    """Whether an effect outside the library is called unexplained, or a class of similar effects."""
    likes = {like for name in trial.truth if name in EFFECTS for like in EFFECTS[name].alike}
    answer = trial.answer
    left = answer.remainder
    of_its_class = bool(likes & set(left.members if left is not None else answer.members))
    verdict = left.verdict if left is not None else answer.verdict
    return verdict in ("unexplained", "not_identifiable") or (verdict == "class" and of_its_class)


def size_errors(trial: Trial) -> list[float]:
    """Return (estimate − truth) / σ of the first quantity of every effect that is rightly named."""
    return [error for e, c in trial.right if (error := _size_error(e, c)) is not None]


def heldout_removed(answer: Answer) -> float | None:
    """Return the share of the held-out discrepancy above the noise floor that the model removes."""
    fit = answer.fit
    if fit is None or not fit.heldout_before > 1.05 * fit.noise_floor:  # also where a number is unknown
        return None
    before, after, floor = (rms**2 for rms in (fit.heldout_before, fit.heldout_after, fit.noise_floor))
    return (before - after) / (before - floor)


def confusion(trials: Iterable[Trial]) -> Counter[tuple[str, str]]:
    """Count (concealed, answered); a class or other verdict is in brackets."""
    return Counter((_joined(t.truth), _joined(t.said) if t.said else f"({t.answer.verdict})") for t in trials)


def calibration(trials: Iterable[Trial]) -> list[tuple[float, Rate]]:
    """Return, for each bin of stated probability, its mean and the rate of right names."""
    pairs = [(e.probability, e.name in t.truth) for t in trials for e in t.answer.effects]
    bins = pairwise(_PROBABILITIES)
    inside = ([(p, hit) for p, hit in pairs if low <= p < high] for low, high in bins)
    return [(float(np.mean([p for p, _ in part])), rate(h for _, h in part)) for part in inside if part]


def _feasible_snr(concealed: Concealed, answer: Answer) -> float | None:
    least = next((f.detectable for f in answer.feasibility if f.name == concealed.name), None)
    return _STANDS_OUT * abs(concealed.values[0]) / least if least and concealed.values else None


def _located(trial: Trial, what: str) -> bool:
    effect = EFFECTS[next(iter(trial.truth))]
    wanted = {"channel": effect.channel.value, "fixed_to": effect.fixed_to.value, "time": effect.time}[what]
    return trial.answer.location is not None and getattr(trial.answer.location, what) == wanted


def _size_error(named: NamedEffect, truth: Concealed) -> float | None:
    if truth.name not in EFFECTS:
        return None
    size = named.parameters.get(EFFECTS[truth.name].quantities[0].name)
    return (size.value - truth.values[0]) / size.sd if size and truth.values and size.sd > 0 else None


def _joined(names: frozenset[str]) -> str:
    return " + ".join(sorted(names)) or NOTHING
