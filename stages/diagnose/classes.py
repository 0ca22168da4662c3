"""Which effects one kind of recording cannot split, and what to record to split them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pipeline.physics.catalogue import CLASSES, EFFECTS, effect


def class_of(name: str) -> tuple[str, ...]:
    """Return the effects that one kind of recording may not tell from this one, itself among them.

    Raises
    ------
    InputError
        When the catalogue has no such effect.
    """
    found = [members for members in CLASSES if effect(name).name in members]
    return found[0] if found else (name,)


def classes_of(names: Sequence[str]) -> tuple[str, ...]:
    """Return the members of the classes of all these effects, in the catalogue's order."""
    members = {member for name in names for member in class_of(name)}
    return tuple(name for name in EFFECTS if name in members)


def alike(first: str, second: str) -> bool:
    """Return whether two effects share a class or the catalogue calls one like the other."""
    return second in class_of(first) or second in effect(first).alike or first in effect(second).alike


def record_next(names: Sequence[str]) -> str:
    """Return a sentence on what to record so that these effects can be told apart, or one confirmed."""
    wanted = _without_repeats([part for name in names for part in _recordings(effect(name).told_apart_by)])
    if not wanted:
        return ""
    purpose = f"confirm {_words(names)}" if len(names) == 1 else f"tell {_words(names)} apart"
    return f"To {purpose}, record: {'; '.join(wanted)}."


def _recordings(told_apart_by: str) -> list[str]:
    parts = re.split(r"[,;]\s*(?![^()]*\))", told_apart_by)
    return [part.removeprefix("or ").strip() for part in parts if part.strip()]


def _without_repeats(parts: Sequence[str]) -> list[str]:
    """Return each part once, and none that another says at more length."""
    return [p for p in dict.fromkeys(parts) if not any(other.startswith(f"{p} ") for other in parts)]


def _words(names: Sequence[str]) -> str:
    *leading, last = names
    return f"{', '.join(leading)} and {last}" if leading else last
