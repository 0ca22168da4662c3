"""Put what an inspection shows beside an answer: a class, something unexplained, or words only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from stages.diagnose.record_next import AGAIN, record_next
from stages.diagnose.result import Diagnosis, EffectFound, Remainder, Verdict


def beside(found: Diagnosis, certain: Sequence[EffectFound], members: Sequence[str]) -> Diagnosis:
    """Return the answer with one more class: a remainder beside what is certain, or the answer itself.

    How likely the ``members`` were by the gauge run alone holds no longer.
    """
    before, causes = found.remainder, found.causes.without(members)
    every = union(members, before.members if before is not None else found.members)
    found = replace(found, causes=causes, record_next=record_next(every, causes))
    if not certain:
        return replace(found, verdict=Verdict.CLASS, members=every, remainder=None)
    # What is unexplained stays so: a class does not contain it.
    is_nameless = before is not None and before.verdict is Verdict.UNEXPLAINED
    left = Remainder(
        Verdict.UNEXPLAINED if is_nameless else Verdict.CLASS, None, every, before.formula if before else ""
    )
    return replace(found, verdict=Verdict.PARTLY, members=(), remainder=left)


def nameless(found: Diagnosis) -> Diagnosis:
    """Return the answer with something unexplained, alone or beside what is certain: no class contains it."""
    if found.verdict in (Verdict.NAMED, Verdict.PARTLY):
        before = found.remainder or Remainder(Verdict.UNEXPLAINED)
        return replace(found, verdict=Verdict.PARTLY, remainder=replace(before, verdict=Verdict.UNEXPLAINED))
    return replace(found, verdict=Verdict.UNEXPLAINED, members=(), effects=())


def in_words(found: Diagnosis, shown: str) -> Diagnosis:
    """Return the answer with what the inspection shows ``shown`` beside an unexplained gauge run.

    No class contains what is unexplained, and a gauge run that shows something refutes nothing.
    """
    said = f"{found.identifiable} {shown}.".lstrip()
    return replace(nameless(found), identifiable=said, record_next=AGAIN)


def union(first: Sequence[str], second: Sequence[str]) -> tuple[str, ...]:
    """Return the names of both, each once."""
    return tuple(dict.fromkeys((*first, *second)))
