"""Artefacts as a tree of plain values beside a set of named arrays, and back.

Any frozen dataclass whose fields are arrays, numbers, strings, None, enumeration members, parameters of a
stage, tuples or mappings of such, or further dataclasses can be encoded; nothing else can, so that nothing is
stored by half. A field with `NOT_STORED` has its default again when it is read.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib import import_module
from itertools import combinations
from types import MappingProxyType, NoneType, UnionType
from typing import Any, NamedTuple, TypeAlias, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"
# Packages of this program.
OWN_PACKAGES = ("pipeline", "stages")
# Modules of classes in stored results, and where they are today.
_MOVED = {"pipeline.recording.checked_frames": "pipeline.recording.checks"}
Array = NDArray[Any]
_UNIONS = (Union, UnionType)
NOT_STORED: Mapping[str, bool] = MappingProxyType({"stored": False})
"""``metadata`` of a dataclass' field that belongs to the computation, not to its result."""


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
        value = _decode(tree, array, {*OWN_PACKAGES, _package(kind.__module__)})
    except (KeyError, TypeError, AttributeError, ImportError, ValidationError) as error:
        raise CodecError(f"does not fit {kind.__qualname__}: {error}") from error
    if type(value) is not kind:
        raise CodecError(f"a {type(value).__qualname__}, not a {kind.__qualname__}")
    return value


def digest(value: object) -> str:
    """Return a SHA-256 of the content of an artefact: equal content, equal digest."""
    return _digest(*encode(value))


def is_digest_of(recorded: str, value: object) -> bool:
    """Return whether a digest is that of a value, or was before its class had fields that are None now."""
    tree, arrays = encode(value)
    own = tree.get("fields") if isinstance(tree, dict) else None
    if not isinstance(tree, dict) or not isinstance(own, dict):
        return recorded == _digest(tree, arrays)
    unset = [name for name, part in own.items() if part is None]
    dropped = (some for count in range(len(unset) + 1) for some in combinations(unset, count))
    older = (tree | {"fields": {n: part for n, part in own.items() if n not in some}} for some in dropped)
    return any(recorded == _digest(t, arrays) for t in older)


def _digest(tree: Json, arrays: dict[str, Array]) -> str:
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
    if isinstance(value, Mapping):
        return {"mapping": _encode(tuple(value.items()), place, arrays)}
    if isinstance(value, BaseModel):
        return {"model": _name_of(type(value)), "values": value.model_dump(mode="json")}
    if is_dataclass(value) and not isinstance(value, type):
        kept = (f.name for f in fields(value) if f.init and f.metadata.get("stored", True))
        content = {name: getattr(value, name) for name in kept}
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


def _decode(tree: Json, array: Callable[[str], Array], packages: set[str]) -> Any:
    if not isinstance(tree, dict):
        return tree
    match tree:
        case {"array": str(name)}:
            return array(name)
        case {"float": str(text)}:
            return float(text)
        case {"tuple": list(items)}:
            return tuple(_decode(i, array, packages) for i in items)
        case {"mapping": items}:
            return dict(_decode(items, array, packages))
        case {"enum": str(name), "member": str(member)}:
            return _class_named(name, packages)[member]
        case {"model": str(name), "values": values}:
            return _class_named(name, packages).model_validate_json(json.dumps(values))
        case {"class": str(name), "fields": dict(content)}:
            kind = _class_named(name, packages)
            known = {f.name for f in fields(kind)}  # an older result may hold more
            values = {k: _decode(v, array, packages) for k, v in content.items() if k in known}
            _refuse_other_kinds(kind, values)
            return kind(**values)
    raise CodecError(f"neither a value nor an array: {sorted(tree)}")


def _refuse_other_kinds(kind: type, values: Mapping[str, Any]) -> None:
    """Refuse an array where a class has none, and a number where it has an array: an older result."""
    arrays = _arrays_of(kind)
    for name, value in values.items():
        holds_array = isinstance(value, np.ndarray)
        if value is not None and arrays[name] not in (None, holds_array):
            raise CodecError(f"{name} is {'an' if holds_array else 'no'} array")


@cache
def _arrays_of(kind: type) -> dict[str, bool | None]:
    """Return for each field of a class whether it is an array; None where it may be an array or not."""
    found: dict[str, bool | None] = {}
    for name, hint in get_type_hints(kind).items():
        parts = [p for p in (get_args(hint) if get_origin(hint) in _UNIONS else (hint,)) if p is not NoneType]
        each = {get_origin(p) is np.ndarray for p in parts if p is not Any}
        found[name] = each.pop() if len(each) == 1 and Any not in parts else None
    return found


def _class_named(name: str, packages: set[str]) -> Any:
    """Return the class ``module:name`` of one of the packages; nothing but data classes is ever called."""
    module, _, path = name.partition(":")
    module = _MOVED.get(module, module)
    if _package(module) not in packages:
        raise CodecError(f"{name} is no class of this program")
    found: Any = import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    if not isinstance(found, type) or not (is_dataclass(found) or issubclass(found, Enum | BaseModel)):
        raise CodecError(f"{name} is no class of data")
    return found


def _package(module: str) -> str:
    return module.partition(".")[0]


def _name_of(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _inside(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name
