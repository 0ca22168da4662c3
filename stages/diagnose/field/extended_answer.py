"""Add what an inspection shows to an answer: a class, something unexplained, or a statement only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from stages.diagnose.record_next import AGAIN, record_next
from stages.diagnose.result import Diagnosis, EffectFound, Remainder, Verdict


def with_class(found: Diagnosis, certain: Sequence[EffectFound], members: Sequence[str]) -> Diagnosis:
    """Return the answer with one more class: a remainder beside what is certain, or the answer itself.

    The probabilities that the gauge run alone gave the ``members`` are dropped.
    """
    before, causes = found.remainder, found.causes.without(members)
    every = each_once(members, before.members if before is not None else found.members)
    found = replace(found, causes=causes, record_next=record_next(every, causes))
    if not certain:
        return replace(found, verdict=Verdict.CLASS, members=every, remainder=None)
    # What is unexplained stays so: a class does not contain it.
    is_nameless = before is not None and before.verdict is Verdict.UNEXPLAINED
    left = Remainder(
        Verdict.UNEXPLAINED if is_nameless else Verdict.CLASS, None, every, before.formula if before else ""
    )
    return replace(found, verdict=Verdict.PARTLY, members=(), remainder=left)


def with_unexplained(found: Diagnosis) -> Diagnosis:
    """Return the answer with something unexplained in place of its class; effects that are certain stay."""
    if found.verdict in (Verdict.NAMED, Verdict.PARTLY):
        before = found.remainder or Remainder(Verdict.UNEXPLAINED)
        return replace(found, verdict=Verdict.PARTLY, remainder=replace(before, verdict=Verdict.UNEXPLAINED))
    return replace(found, verdict=Verdict.UNEXPLAINED, members=(), effects=())


def with_statement(found: Diagnosis, statement: str) -> Diagnosis:
    """Return the answer of an unexplained gauge run, with the statement of what the inspection shows.

    No class contains what is unexplained, and a gauge run that shows something refutes nothing.
    """
    said = f"{found.identifiable} {statement}.".lstrip()
    return replace(with_unexplained(found), identifiable=said, record_next=AGAIN)


def each_once(first: Sequence[str], second: Sequence[str]) -> tuple[str, ...]:
    """Return the names of both, each once."""
    return tuple(dict.fromkeys((*first, *second)))
