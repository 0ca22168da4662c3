"""The scores of a proof with their goals and intervals, as rows of one table."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from stages.diagnose.drill.score import Rate, Scores, Trial, score

# Each figure of `Scores`, its meaning and its goal; figures without a goal are only reported.
_RATES: tuple[tuple[str, str, str], ...] = (
    ("false_alarms", "False alarms where nothing is hidden", "0"),
    ("detected", "Detected at SNR ≥ 8", "≥ 99 %"),
    ("detected_any", "Detected at any size", ""),
    ("located", "Located: channel, what it is fixed to and time behaviour", "≥ 97 %"),
    ("channel_right", "Located: channel", ""),
    ("fixed_to_right", "Located: what it is fixed to", ""),
    ("time_right", "Located: behaviour in time", ""),
    ("named_identifiable", "Named exactly where identifiable (single effects)", "≥ 95 %"),
    ("named_exactly", "Named exactly (all single effects)", ""),
    ("contained", "Name or class contains the truth (found single effects)", "≥ 99 %"),
    ("misnamed", "Confident wrong name", "≤ 0.5 %"),
    ("pairs_named", "Pairs: both named", "≥ 90 %"),
    ("pairs_identifiable", "Pairs: both named, where both are identifiable", ""),
    ("unknown_owned", "Left out of the library (SNR ≥ 8): unexplained or a class of its likes", "≥ 90 %"),
    ("unknown_misnamed", "Left out of the library (SNR ≥ 8): confidently misnamed", "≤ 5 %"),
    ("size_in_95", "Sizes within their 95 % interval", "93–97 %"),
)


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
    def text(self) -> str:
        """The row in one line."""
        goal = f" (goal {self.goal})" if self.goal else ""
        if self.value is None:
            return f"{self.words}: none to count{goal}"
        if self.interval is None:
            return f"{self.words}: {self.value:+.2f} of {self.of}{goal}"
        low, high = self.interval
        hits = round(self.value * self.of)
        return f"{self.words}: {hits} of {self.of}, {self.value:.1%} [{low:.1%}, {high:.1%}]{goal}"


def figures(trials: Iterable[Trial]) -> tuple[Figure, ...]:
    """Return the rows of the table in the demand's order."""
    scores = score(trials)
    return (*(_of_rate(scores, *row) for row in _RATES), *_others(scores))


def _of_rate(scores: Scores, name: str, words: str, goal: str) -> Figure:
    rate: Rate = getattr(scores, name)
    return Figure(name, words, goal, _known(rate.share), rate.of, rate.interval)


def _others(scores: Scores) -> tuple[Figure, ...]:
    bias, removed = _known(scores.size_bias_sigma), _known(scores.heldout_removed)
    return (
        Figure("size_bias_sigma", "Mean error of sizes in σ", "within ±0.2", bias, scores.size_count, None),
        Figure(
            "heldout_removed", "Held-out discrepancy above the noise floor removed, median", "≥ 0.97",
            removed, scores.heldout_count, None,
        ),
    )  # fmt: skip


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value
