"""JSON and YAML files: read up to a size, checked key by key, refused by file and key."""

from __future__ import annotations

import difflib
import json
import math
import sys
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import InputError

# No larger than what boresight itself writes of the longest run.
LARGEST_JSON_BYTES = 256 << 20


def read_json(file: Path) -> Any:
    """Return what a JSON file holds.

    Raises
    ------
    OSError
        When it cannot be read.
    ValueError
        When it is too large, not UTF-8, not JSON, or nested too deeply.
    """
    size = file.stat().st_size
    if size > LARGEST_JSON_BYTES:
        raise ValueError(f"it is {size} bytes long, more than {LARGEST_JSON_BYTES}")
    return parse_json(file.read_text("utf-8"))


def parse_json(text: str | bytes) -> Any:
    """Return what a JSON text holds; raises ValueError when it is not JSON or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def json_number(value: float) -> float | None:
    """Return a finite number, None for NaN and infinity, which JSON does not have."""
    return float(value) if math.isfinite(value) else None


# A file of settings has some kB; a larger one than this is not one, and is refused unread.
LARGEST_YAML_BYTES = 1_000_000
# Likeness of two keys, of 1, from which one is taken for the other misspelt; frames and frame_rate have 0.63.
_MISSPELT = 0.8


def read_yaml(file: Path) -> Section:
    """Read a YAML file whose top level is a mapping.

    Raises
    ------
    InputError
        When the file is absent, too large, not YAML, empty, not a mapping, or repeats a key.
    """
    try:
        size = file.stat().st_size
        if size > LARGEST_YAML_BYTES:
            raise InputError(
                file, f"is {size} bytes long", expected=f"a YAML file of at most {LARGEST_YAML_BYTES} bytes"
            )
        text = file.read_text("utf-8")
    except OSError as error:
        raise InputError(file, f"cannot be read ({error.strerror})", expected="a YAML file") from error
    except UnicodeDecodeError as error:
        raise InputError(file, "is not UTF-8 text", expected="a YAML file") from error
    return parse_yaml(text, file)


def parse_yaml(text: str, file: Path) -> Section:
    """Parse YAML text whose top level is a mapping; ``file`` is named in complaints. See `read_yaml`."""
    try:
        values = yaml.load(text, _StrictLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or str(error)
        place = f"line {mark.line + 1}" if mark else ""
        raise InputError(file, f"is not valid YAML: {problem}", place=place) from error
    except (ValueError, RecursionError) as error:
        raise InputError(file, f"is not valid YAML: {error}") from error
    if not isinstance(values, dict):
        found = "nothing" if values is None else f"a {type(values).__name__}"
        raise InputError(file, f"holds {found} at its top level", expected="a mapping of keys to values")
    return Section(file, values)


class _StrictLoader(yaml.SafeLoader):
    """Safe loader that refuses repeated keys and aliases (which can grow without bound)."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            event = self.get_event()  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem="aliases are not used here", problem_mark=event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if key.tag != "tag:yaml.org,2002:str" or key.value in seen:
                problem = f"key {key.value!r} occurs twice or is not a plain word"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


@dataclass(frozen=True)
class Section:
    """A mapping read from ``file``; ``place`` is its dotted path there. Its getters complain precisely."""

    file: Path
    values: Mapping[str, object]
    place: str = ""

    def path(self, key: str) -> str:
        """Return the dotted path of a key."""
        return f"{self.place}.{key}" if self.place else key

    def fail(self, key: str, problem: str, expected: str = "", hint: str = "") -> InputError:
        """Return the error that says what is wrong with a key."""
        return InputError(self.file, problem, place=f"key {self.path(key)}", expected=expected, hint=hint)

    def refuse_unknown(self, known: Sequence[str]) -> None:
        """Raise `InputError` for a key that is not ``known``, naming the nearest right one."""
        for key in self.values:
            if key not in known:
                near = difflib.get_close_matches(str(key), known, 1)
                hint = f"did you mean {near[0]}?" if near else ""
                raise self.fail(str(key), "is not a key of this file", f"one of {', '.join(known)}", hint)

    def has(self, key: str) -> bool:
        """Tell whether a key is there with a value."""
        return self.values.get(key) is not None

    def require(self, key: str, expected: str) -> object:
        """Return a value; raise `InputError` naming the nearest key where it is missing or empty."""
        if self.has(key):
            return self.values[key]
        if key in self.values:
            raise self.fail(key, "is empty", expected, "write its value behind the colon")
        near = difflib.get_close_matches(key, map(str, self.values), 1, _MISSPELT)
        raise self.fail(key, "is missing", expected, f"is {near[0]} meant?" if near else "add it to the file")

    def text(self, key: str) -> str:
        """Return a non-empty string."""
        value = self.require(key, "a word")
        if not isinstance(value, str) or not value.strip():
            raise self.fail(key, f"is {value!r}", "a word")
        return value

    def choice(self, key: str, among: Sequence[str]) -> str:
        """Return a string that must be one of ``among``."""
        value = self.text(key)
        if value not in among:
            near = difflib.get_close_matches(value, among, 1)
            hint = f"did you mean {near[0]}?" if near else ""
            raise self.fail(key, f"is {value!r}", f"one of {', '.join(among)}", hint)
        return value

    def number(self, key: str, *, least: float = -math.inf, above: float = -math.inf) -> float:
        """Return a finite number, at least ``least`` and greater than ``above``."""
        return self._number(key, self.require(key, "a number"), least, above)

    def integer(self, key: str, *, least: int) -> int:
        """Return a whole number of at least ``least``."""
        value = self.require(key, "a whole number")
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise self.fail(key, f"is {value!r}", f"a whole number of at least {least}")
        return value

    def numbers(self, key: str, count: int, *, least: float = -math.inf) -> tuple[float, ...]:
        """Return ``count`` finite numbers."""
        value = self.require(key, f"{count} numbers")
        if not isinstance(value, list) or len(value) != count:
            raise self.fail(key, f"is {_short(value)}", f"a list of {count} numbers")
        return tuple(self._number(f"{key}[{i}]", v, least, -math.inf) for i, v in enumerate(value))

    def section(self, key: str) -> Section:
        """Return the mapping below a key."""
        value = self.require(key, "a mapping of keys to values")
        if not isinstance(value, dict):
            raise self.fail(key, f"is {_short(value)}", "a mapping of keys to values")
        return Section(self.file, value, self.path(key))

    def sections(self, key: str) -> Iterator[Section]:
        """Yield the mappings of a list."""
        value = self.require(key, "a list of mappings")
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            raise self.fail(key, f"is {_short(value)}", "a list of mappings")
        return (Section(self.file, v, self.path(f"{key}[{i}]")) for i, v in enumerate(value))

    def _number(self, key: str, value: object, least: float, above: float) -> float:
        wanted = "a finite number"
        wanted += f" of at least {least:g}" if least > -math.inf else ""
        wanted += f" greater than {above:g}" if above > -math.inf else ""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(key, f"is {_short(value)}", wanted, _number_hint(value))
        if not abs(value) <= sys.float_info.max or value < least or value <= above:
            raise self.fail(key, f"is {_short(value)}", wanted)
        return float(value)


def _short(value: object) -> str:
    """Return a value's text, cut to what fits a message."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _number_hint(value: object) -> str:
    """Say what to write instead, e.g. of ``1e-3``, which YAML takes for text."""
    try:
        return f"write {float(value)!r} without quotes" if isinstance(value, str) else ""
    except ValueError:
        return "write a plain number, without a unit"
