"""Which recordings would best tell the possible causes apart."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from pipeline.physics.catalogue import effect
from stages.diagnose.causes import NONE, Causes
from stages.diagnose.inference import SURE

AGAIN = (
    "To see what the pattern depends on, record the gauge run again: with probe or gauge rolled by 90°, at "
    "another speed, and after warming up."
)
# As many recordings as a person is asked for, and as many causes as are counted up in one sentence.
_MOST, _NAMED = 3, 4
# Causes that are less likely than the accepted probability of a wrong name are not listed.
_LEAST = 1 - SURE
# What a recording says of two causes that others already tell apart counts half as much, each time.
_AGAIN = 0.5
_TO_AND_FRO = "the way to and fro"
_OTHER_SPEED = "the same way at another speed, with a stop"
_LONGER = "a longer run"


@dataclass(frozen=True)
class _Possible:
    """A cause, perhaps with a course, and its weight."""

    name: str
    course: str
    weight: float


def record_next(names: Sequence[str], causes: Causes = NONE) -> str:
    """Return a sentence on what to record to tell these effects apart, or to confirm a single one.

    It asks for the few recordings that separate the most probability. Effects that ``causes`` say nothing
    about count as much as the likeliest that looks like them, or else as the likeliest of all.
    """
    possible = [one for name in names for one in _courses(name, names, causes) if one.weight > 0]
    possible = possible or [one for name in names for one in _courses(name, names, NONE)]
    if not possible:
        return ""
    if len(possible) == 1:
        (one,) = possible
        wanted, purpose = tuple(_parts(one.name)[:_MOST]), f"confirm {one.name}"
    else:
        wanted, purpose = _most_telling(possible), _purpose(possible)
    return f"To {purpose}, record: {'; '.join(wanted)}." if wanted else ""


def _courses(name: str, names: Sequence[str], causes: Causes) -> list[_Possible]:
    """Return a cause with each of its possible courses."""
    known, like = causes.of(name), causes.like(name, names)
    if known is None:
        likeliest = max((c.probability for c in causes.laws), default=1.0)
        return [_Possible(name, "", likeliest if like is None else like.probability)]
    if not known.courses:
        return [_Possible(name, "", known.probability)]
    weight = defaultdict[str, float](float)
    for c in known.courses:
        weight[c.kind] += known.probability * c.probability
    return [_Possible(name, kind, p) for kind, p in weight.items()]


def _purpose(possible: Sequence[_Possible]) -> str:
    """Return what the recordings are for: the likeliest few names, in the order given."""
    weight = dict[str, float]()
    for one in possible:
        weight[one.name] = weight.get(one.name, 0.0) + one.weight
    if len(weight) == 1:
        return f"tell how {possible[0].name} changes over the run"
    likely = [name for name in weight if weight[name] >= _LEAST * max(weight.values())]
    likeliest = sorted(likely, key=lambda name: -weight[name])
    listed = likely if len(likely) <= _NAMED else [n for n in likely if n in likeliest[: _NAMED - 1]]
    *leading, last = (*listed, "the others") if len(listed) < len(likely) else listed
    if not leading:
        return f"confirm {last}"
    return f"tell {', '.join(leading)} and {last} apart"


def _most_telling(possible: Sequence[_Possible]) -> tuple[str, ...]:
    """Return the recordings that, one after the other, separate the most of what is still undecided."""
    pairs = [(_separating(a, b), a.weight * b.weight) for a, b in combinations(possible, 2)]
    every = dict.fromkeys(part for parts, _ in pairs for part in parts)
    chosen: list[str] = []
    while len(chosen) < _MOST:
        gain = {
            part: sum(w * _AGAIN ** sum(c in parts for c in chosen) for parts, w in pairs if part in parts)
            for part in every
            if not any(f"{part} ".startswith(f"{c} ") or f"{c} ".startswith(f"{part} ") for c in chosen)
        }  # fmt: skip
        best = max(gain, key=lambda part: gain[part], default=None)
        if best is None or gain[best] == 0:
            break
        chosen.append(best)
    return tuple(chosen)


def _separating(first: _Possible, second: _Possible) -> tuple[str, ...]:
    """Return the recordings that tell two causes apart, by their laws or by their courses."""
    names, courses = (first.name, second.name), {first.course, second.course}
    by_law = [p for name in names for p in _parts(name) if _serves(p, names)] if names[0] != names[1] else []
    if "" in courses or len(courses) == 1:
        return tuple(by_law)
    kinds = {kind for course in courses for kind in course.split(" and ")}
    if "reversal" in kinds:
        return (*by_law, _TO_AND_FRO)
    return (*by_law, _OTHER_SPEED if kinds & {"speed", "distance"} else _LONGER)


def _serves(part: str, names: Sequence[str]) -> bool:
    """Return whether a recording tells these two apart: some serve against one other cause alone."""
    against = re.search(r"\(against (.*)\)", part)
    return against is None or against[1].replace(" ", "_") in names


def _parts(name: str) -> list[str]:
    """Return the recordings that tell an effect from what looks like it, each once."""
    parts = re.split(r"[,;]\s*(?![^()]*\))", effect(name).told_apart_by)
    each = dict.fromkeys(part.removeprefix("or ").strip() for part in parts if part.strip())
    # What another part contains at its start is said by that.
    return [p for p in each if not any(other.startswith(f"{p} ") for other in each)]
