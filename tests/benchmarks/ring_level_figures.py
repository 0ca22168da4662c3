"""Counts at ring level beyond the drill's table.

P-values of nulls, courses, probabilities, several effects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import kstest

from pipeline.drill.score import SNR, Rate, Trial, rate
from pipeline.physics.effect import CourseKind
from stages.diagnose.channels import TRAVEL_EFFECTS
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.inference import SURE

Line = dict[str, Any]
# Largest error of a step's time that counts as found.
_NEAR_S = 0.1
_BINS = (0.0, 1e-3, 0.01, 0.1, 0.5, 0.9, 0.99, 1.000001)
_CREDIBLE = 0.9
_EXPECTED = (0.1, 0.5, 4.0, 8.0)


def more_figures(lines: Sequence[Line], trials: Sequence[Trial]) -> Iterator[str]:
    """Yield sentences with the figures of these results and of the trials made of them."""
    answered = [line for line in lines if "failed" not in line]
    of_several = [(line, t) for line, t in zip(lines, trials, strict=True) if "failed" not in line]
    yield from _of_nulls([line for line in answered if not line["concealed"]])
    yield from _of_courses(answered)
    yield from _of_each([one for one in of_several if len(one[1].concealed) > 1 and not one[1].left_out])
    known = [line for line in answered if not line["left_out"]]
    yield from _of_probabilities(known)
    sets = [hit for line in known if (hit := _in_credible_set(line)) is not None]
    yield f"{_CREDIBLE:.0%} credible sets hold the truth: {_words(rate(sets))}"
    yield f"ended without an answer: {len(lines) - len(answered)} of {len(lines)}"
    seconds = [line["cpu_s"] for line in lines]
    yield f"CPU s a case: {np.median(seconds):.1f} (median), {np.max(seconds):.0f} (most)"


def _words(of: Rate) -> str:
    low, high = of.interval
    return f"{of.count} of {of.of} [{low:.1%}, {high:.1%}]"


def _of_nulls(nulls: Sequence[Line]) -> Iterator[str]:
    p_values = [line["answer"]["global_p"] for line in nulls if line["answer"].get("global_p") is not None]
    if p_values:
        below = " ".join(f"{q:g}: {np.mean(np.array(p_values) < q):.3f}" for q in (0.5, 0.2, 0.1, 0.05, 0.01))
        # Because p is corrected for all tests, it may be conservative, but never too small.
        test = kstest(p_values, "uniform", alternative="greater").pvalue
        yield f"share of {len(p_values)} nulls with p below {below}; chance of so many small ones {test:.2g}"
    yield from _expected(nulls)


def _expected(nulls: Sequence[Line]) -> Iterator[str]:
    """Yield the density of the numbers of scores that are expected by chance, from which p is made."""
    expected = np.array([e for line in nulls if (e := line.get("expected")) is not None])
    if len(expected):
        shares = ", ".join(f"{most:g}: {np.mean(expected < most) / most:.3f}" for most in _EXPECTED)
        yield f"share of {len(expected)} nulls per unit of the number expected by chance, up to {shares}"


def _of_courses(lines: Sequence[Line]) -> Iterator[str]:
    """Yield how often the course of a rightly named effect is right, and the time of a step."""
    named = [
        (line["concealed"][0][2], e["course"])
        for line in lines
        if line["mode"] == "courses" and line["answer"]["verdict"] in ("named", "partly")
        for e in line["answer"]["effects"]
        if e["name"] == line["concealed"][0][0] and e.get("course")
    ]
    right = [(true, found) for true, found in named if true["kind"] == found["kind"]]
    steps = [(t["time_s"], f["time_s"]) for t, f in right if t["kind"] == CourseKind.STEP]
    if named:
        yield f"course right where the law is named: {_words(Rate(len(right), len(named)))}"
        yield f"steps within {_NEAR_S} s: {_words(rate(abs(f['value'] - t) <= _NEAR_S for t, f in steps))}"
        yield f"steps within 2 σ: {_words(rate(abs(f['value'] - t) <= 2 * f['sd'] for t, f in steps))}"


def _of_each(cases: Sequence[tuple[Line, Trial]]) -> Iterator[str]:
    """Yield precision and recall of single names where several effects are concealed."""
    right, said = sum(len(t.right) for _, t in cases), sum(len(t.given) for _, t in cases)
    recalled = [
        (any(found is c for _, found in t.right), ideal)
        for line, t in cases
        for c, snr, ideal in zip(
            t.concealed, line["snr"], line.get("ideal", [None] * len(t.concealed)), strict=True
        )
        if snr is not None and snr >= SNR
    ]
    if cases:
        yield f"several effects, {len(cases)} cases: names that are right {_words(Rate(right, said))}"
        yield f"several effects: of those at SNR ≥ {SNR:g} named {_words(rate(hit for hit, _ in recalled))}"
        at_best = [(hit, p > SURE) for hit, p in recalled if p is not None]
        yield f"of these, could be named (rings, fiducials) {_words(rate(able for _, able in at_best))}"
        yield f"of those that could be named, named {_words(rate(hit for hit, able in at_best if able))}"
        yield f"of those that could not, named {_words(rate(hit for hit, able in at_best if not able))}"


def _law(name: str) -> str:
    return name.split(",")[0].split(" ")[0]


def _of_probabilities(lines: Sequence[Line]) -> Iterator[str]:
    """Yield how often a law is present when given such a probability, and the Brier score over all laws."""
    pairs, untold = [], 0
    for line in lines:
        told = {law: sum(c["probability"] for c in line["answer"].get("candidates", ()) if law in
                         map(_law, c["names"])) for law in LIBRARY}  # fmt: skip
        true = {c[0] for c in line["concealed"]}
        # Candidates come from rings: those without a probability are excluded, unless rings cannot show them.
        is_told = {law for law, p in told.items() if p > 0 or law in true - set(TRAVEL_EFFECTS)}
        told |= {e["name"]: e["probability"] for e in line["answer"]["effects"]}
        is_told |= {e["name"] for e in line["answer"]["effects"]}
        untold += len(true - is_told)
        pairs += [(told[law], law in true) for law in sorted(is_told)]
    if not pairs:
        return
    chance, there = np.array(pairs, float).T
    for low, high in pairwise(_BINS):
        inside = (chance >= low) & (chance < high)
        if inside.any():
            told = _words(rate(map(bool, there[inside])))
            yield f"told with {low:g} to {high:.3g} (mean {chance[inside].mean():.3f}): there in {told}"
    yield f"effects of motion and encoder that no probability is told of: {untold}"
    yield f"Brier score a case: {np.sum((chance - there) ** 2) / len(lines):.4f}"


def _in_credible_set(line: Line) -> bool | None:
    """Return whether the likeliest names that reach `_CREDIBLE` hold the truth; None where none is given.

    Rings and fiducials do not show the effects of motion and encoder.
    """
    true = sorted(c[0] for c in line["concealed"] if c[0] not in TRAVEL_EFFECTS)
    each = sorted(line["answer"].get("candidates", ()), key=lambda c: -c["probability"])
    if not each or not true:
        return None
    before = np.cumsum([c["probability"] for c in each]) - [c["probability"] for c in each]
    inside = [c for c, sum_before in zip(each, before, strict=True) if sum_before < _CREDIBLE]
    return any(sorted(map(_law, c["names"])) == true for c in inside)
