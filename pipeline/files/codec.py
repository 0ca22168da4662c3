"""Artefacts as a tree of plain values beside a set of named arrays, and back.

Any frozen dataclass whose fields are arrays, numbers, strings, None, enumeration members, tuples of such, or
further dataclasses can be encoded; nothing else can, so that nothing is stored by half.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, NamedTuple, TypeAlias, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"
Array = NDArray[Any]


class CodecError(ValueError):
    """A stored tree that does not fit the class it is to become."""


class Encoded(NamedTuple):
    """``tree`` holds the plain values and names the ``arrays``."""

    tree: Json
    arrays: dict[str, Array]


def encode(value: object) -> Encoded:
    """Take an artefact apart.

    Raises
    ------
    TypeError
        When a field holds something that cannot be stored; names the field.
    """
    arrays: dict[str, Array] = {}
    return Encoded(_encode(value, "", arrays), arrays)


def decode(tree: Json, array: Callable[[str], Array], kind: type) -> Any:
    """Put an artefact of class ``kind`` together again; ``array`` returns the array of a name.

    Raises
    ------
    CodecError
        When the tree was made from another class or another version of it.
    """
    try:
        value = _decode(tree, array, _classes_within(kind))
    except (KeyError, TypeError, AttributeError) as error:
        raise CodecError(f"does not fit {kind.__qualname__}: {error}") from error
    if type(value) is not kind:
        raise CodecError(f"a {type(value).__qualname__}, not a {kind.__qualname__}")
    return value


def digest(value: object) -> str:
    """Return a SHA-256 of the content of an artefact: equal content, equal digest."""
    tree, arrays = encode(value)
    total = hashlib.sha256(canonical(tree))
    for name, array in sorted(arrays.items()):
        total.update(f"{name} {array.dtype.str} {array.shape}".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def canonical(tree: Json) -> bytes:
    """Return the one JSON text of a tree, for hashing."""
    return json.dumps(tree, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def _encode(value: object, place: str, arrays: dict[str, Array]) -> Json:
    if isinstance(value, Enum):
        return {"enum": _name_of(type(value)), "member": value.name}
    if isinstance(value, np.ndarray):
        return _encode_array(value, place, arrays)
    if isinstance(value, np.generic):
        return _encode(value.item(), place, arrays)
    if isinstance(value, float):
        return value if math.isfinite(value) else {"float": str(value)}
    if value is None or isinstance(value, bool | int | str):
        return value
    return _encode_compound(value, place, arrays)


def _encode_compound(value: object, place: str, arrays: dict[str, Array]) -> Json:
    if type(value) is tuple:
        return {"tuple": [_encode(v, _inside(place, str(i)), arrays) for i, v in enumerate(value)]}
    if is_dataclass(value) and not isinstance(value, type):
        content = {f.name: getattr(value, f.name) for f in fields(value) if f.init}
        return {
            "class": _name_of(type(value)),
            "fields": {k: _encode(v, _inside(place, k), arrays) for k, v in content.items()},
        }
    raise TypeError(f"{place or 'artefact'}: a {type(value).__qualname__} cannot be stored")


def _encode_array(value: Array, place: str, arrays: dict[str, Array]) -> Json:
    if value.dtype.hasobject:
        raise TypeError(f"{place or 'artefact'}: an array of Python objects cannot be stored")
    name = place or "value"
    arrays[name] = np.asarray(value)
    return {"array": name}


def _decode(tree: Json, array: Callable[[str], Array], classes: Mapping[str, type]) -> Any:
    if not isinstance(tree, dict):
        return tree
    match tree:
        case {"array": str(name)}:
            return array(name)
        case {"float": str(text)}:
            return float(text)
        case {"tuple": list(items)}:
            return tuple(_decode(i, array, classes) for i in items)
        case {"enum": str(name), "member": str(member)}:
            return classes[name][member]  # type: ignore[index]
        case {"class": str(name), "fields": dict(content)}:
            return classes[name](**{k: _decode(v, array, classes) for k, v in content.items()})
    raise CodecError(f"neither a value nor an array: {sorted(tree)}")


def _classes_within(kind: type) -> dict[str, type]:
    """Return every dataclass and enumeration that the annotations of ``kind`` lead to, by name."""
    found: dict[str, type] = {}
    waiting: list[Any] = [kind]
    while waiting:
        hint = waiting.pop()
        waiting.extend(get_args(hint))
        if isinstance(hint, type) and (is_dataclass(hint) or issubclass(hint, Enum)):
            if _name_of(hint) in found:
                continue
            found[_name_of(hint)] = hint
            if is_dataclass(hint):
                waiting.extend(get_type_hints(hint).values())
    return found


def _name_of(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _inside(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name
