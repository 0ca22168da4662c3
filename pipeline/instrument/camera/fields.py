"""Checked access to the fields of a parsed YAML mapping; every refusal names file, key and expectation."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pipeline.errors import InputError

LARGEST_SIDE_PX = 65535


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean 'x'?`` for the known word most like ``word``, or an empty string."""
    found = difflib.get_close_matches(word.lower().replace("-", "_"), list(known), n=1, cutoff=0.5)
    return f"; did you mean {found[0]!r}?" if found else ""


class Fields:
    """A mapping read field by field, remembering which keys were asked for.

    Parameters
    ----------
    mapping
        As a YAML parser returns it; anything but a mapping is refused.
    file, section
        Named in errors; ``section`` may be empty.
    """

    def __init__(self, mapping: object, file: Path, section: str = "") -> None:
        self.file, self.section, self._asked = file, section, set[str]()
        if not isinstance(mapping, Mapping):
            raise InputError(
                file, f"is {_kind(mapping)}", place=section, expected="a mapping of keys to values"
            )
        self._mapping: Mapping[object, object] = mapping

    def __contains__(self, key: str) -> bool:
        return key in self._mapping

    def error(self, key: str, problem: str, expected: str = "", hint: str = "") -> InputError:
        """Return an error placed at ``key`` of this section."""
        place = ": ".join(part for part in (self.section, key) if part)
        return InputError(self.file, problem, place=place, expected=expected, hint=hint)

    def value(self, key: str, expected: str) -> object:
        """Return the raw value of a required key."""
        self._asked.add(key)
        if key not in self._mapping:
            others = [k for k in self._mapping if isinstance(k, str) and k not in self._asked]
            raise self.error(key, f"missing{_looks_like(key, others)}", expected)
        value = self._mapping[key]
        if value is None:
            raise self.error(key, "empty", expected)
        return value

    def section_of(self, key: str) -> Fields:
        """Return the mapping under ``key`` as fields of its own."""
        place = ": ".join(part for part in (self.section, key) if part)
        return Fields(self.value(key, "a mapping of keys to values"), self.file, place)

    def text(self, key: str) -> str:
        """Return a non-empty string."""
        value = self.value(key, "text")
        if not isinstance(value, str) or not value:
            raise self.error(key, f"is {_kind(value)}", "text")
        return value

    def number(self, key: str, *, positive: bool = False) -> float:
        """Return a finite number."""
        expected = "a positive number" if positive else "a number"
        return self._number(key, self.value(key, expected), positive)

    def numbers(
        self, key: str, least: int, most: int | None = None, *, positive: bool = False
    ) -> list[float]:
        """Return a list of ``least`` to ``most`` finite numbers (exactly ``least`` when ``most`` is None)."""
        most = least if most is None else most
        count = f"{least}" if least == most else f"{least} to {most}"
        expected = f"a list of {count} {'positive ' if positive else ''}numbers"
        value = self.value(key, expected)
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise self.error(key, f"is {_kind(value)}", expected)
        if not least <= len(value) <= most:
            raise self.error(key, f"has {len(value)} entries", expected)
        return [self._number(f"{key}[{i}]", v, positive) for i, v in enumerate(value)]

    def pair(self, key: str, *, positive: bool = False) -> tuple[float, float]:
        """Return two finite numbers."""
        first, second = self.numbers(key, 2, positive=positive)
        return first, second

    def integer(self, key: str) -> int:
        """Return an integer from 1 to `LARGEST_SIDE_PX`, such as the side of an image."""
        expected = f"a whole number from 1 to {LARGEST_SIDE_PX}"
        return self._size(key, self.value(key, expected), expected)

    def image_size(self, key: str = "image_size") -> tuple[int, int]:
        """Return [width, height] in px."""
        expected = f"[width, height] in whole pixels from 1 to {LARGEST_SIDE_PX}"
        value = self.value(key, expected)
        if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
            raise self.error(key, f"is {_kind(value)}", expected)
        return self._size(key, value[0], expected), self._size(key, value[1], expected)

    def refuse_others(self) -> None:
        """Raise for the first key that nobody asked for."""
        for key in self._mapping:
            if key not in self._asked:
                near = nearest(str(key), self._asked)
                raise self.error(str(key), f"unknown key{near}", "only " + ", ".join(sorted(self._asked)))

    def _number(self, place: str, value: object, positive: bool) -> float:
        expected = "a positive number" if positive else "a finite number"
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(place, f"is {_kind(value)}", expected, _number_hint(value))
        number = _as_float(value)
        if not math.isfinite(number) or (positive and number <= 0):
            raise self.error(place, f"is {number}", expected)
        return number

    def _size(self, key: str, value: object, expected: str) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(key, f"holds {_kind(value)}", expected)
        if not 1 <= value <= LARGEST_SIDE_PX:
            raise self.error(key, f"holds {_as_float(value):.17g}", expected)
        return value


def _as_float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _kind(value: object) -> str:
    match value:
        case None:
            return "empty"
        case str():
            return f"the text {value[:40]!r}"
        case bool():
            return "yes or no"
        case int() | float():
            return "a number"
        case Mapping():
            return "a mapping"
        case Sequence():
            return f"a list of {len(value)} entries"
        case _:
            return f"a {type(value).__name__}"


def _looks_like(key: str, others: list[str]) -> str:
    found = difflib.get_close_matches(key, others, n=1, cutoff=0.6)
    return f"; is {found[0]!r} meant to be it?" if found else ""


def _number_hint(value: object) -> str:
    if not isinstance(value, str):
        return ""
    try:
        number = float(value)
    except ValueError:
        return ""
    return f"YAML takes this as text: write {number!r} without quotes, and exponents as 1.0e-3"
