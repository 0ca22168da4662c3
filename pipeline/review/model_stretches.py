"""The model in stretches: each of model.glb's primitives as a file, so that only the visible part is loaded.

The container is glTF 2.0's binary form (Khronos, 2021, § 4): a header, a JSON chunk, a binary chunk.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.artefacts.measured import Trajectory
from pipeline.errors import InputError
from pipeline.files.disk import FileStamp, stamp_of
from pipeline.files.json_yaml import parse_json
from pipeline.geometry.axis import PipeAxis
from pipeline.review.run_files import RunFiles

Json = dict[str, Any]
_GLTF, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_LARGEST_DOCUMENT = 256 << 20  # bytes of JSON that are read at most; a larger one is refused
_VARIANTS = "KHR_materials_variants"
_MOST_STATIONS = 2000  # of an axis: at 100 m one every 5 cm


@dataclass(frozen=True)
class Stretch:
    """A part of the model between two distances; ``triangles`` is its number of triangles."""

    from_mm: float
    to_mm: float
    triangles: int


@dataclass(frozen=True)
class StretchedModel:
    """A binary glTF whose one mesh has a primitive for each stretch.

    Attributes
    ----------
    file : Path
    document : dict
        Its JSON.
    binary : (B,) uint8
        Its buffer, mapped from the file.
    axis : PipeAxis
    """

    file: Path
    document: Json
    binary: Byte
    axis: PipeAxis

    def stretches(self) -> tuple[Stretch, ...]:
        """Return the place of each primitive along the pipe.

        Raises
        ------
        InputError
            When the file was not written by boresight.
        """
        with _as_written(self.file):
            accessors, primitives = self.document["accessors"], self._primitives
            boxes = [accessors[p["attributes"]["POSITION"]] for p in primitives]
            edges = np.array([[box["min"], box["max"]] for box in boxes], float).reshape(-1, 2, 3)
            triangles = [int(accessors[p["indices"]]["count"]) // 3 for p in primitives]
            corners = 1000 * np.stack(
                [edges[:, list(ends), [0, 1, 2]] for ends in product((0, 1), repeat=3)], 1
            )
            along = _distances(self.axis, corners)
            spans = zip(along.min(1).tolist(), along.max(1).tolist(), triangles, strict=True)
            return tuple(Stretch(*span) for span in spans)

    def stretch(self, number: int, is_photo_alone: bool = False) -> bytes:
        """Return one primitive with its materials and pictures, or with the photo alone, as binary glTF.

        Raises
        ------
        InputError
            When there is no such stretch, or the file was not written by boresight.
        """
        if not 0 <= number < len(self._primitives):
            raise InputError("model", f"there is no stretch {number}")
        with _as_written(self.file):
            most = 1 if is_photo_alone else None
            return _packed(*_alone(self.document, self._primitives[number], self.binary, most))

    @property
    def _primitives(self) -> list[Json]:
        found: list[Json] = self.document["meshes"][0]["primitives"]
        return found


def _distances(axis: PipeAxis, point_p: Float) -> Float:
    """Return distances (N, M) of points (N, M, 3) along the axis, accurate enough to locate a stretch.

    `to_pipe` would be exact, but loads SciPy and Numba, which would delay the first view.
    """
    step = max(len(axis.distance_mm) // _MOST_STATIONS, 1)
    at, origin, tangent = axis.distance_mm[::step], axis.origin_p[::step], axis.R_pa[::step, :, 2]
    found = np.empty(point_p.shape[:2])
    for k, corners in enumerate(point_p):  # one stretch at a time, to limit memory
        nearest = np.sum((corners[:, None] - origin) ** 2, axis=2).argmin(1)
        found[k] = at[nearest] + np.sum((corners - origin[nearest]) * tangent[nearest], axis=1)
    return found


def model_of(files: RunFiles) -> StretchedModel:
    """Return a run's model.

    Raises
    ------
    InputError
        When there is none, or it is not one that boresight wrote.
    """
    file = files.file("model.glb")
    if not file.is_file():
        raise InputError(file, "is missing", hint="finish the run: boresight run")
    return _model(file, stamp_of(file), files)


@lru_cache(maxsize=2)
def _model(file: Path, _as_it_is: FileStamp, files: RunFiles) -> StretchedModel:
    return read_model(file, files.artefact(Trajectory).axis)


def read_model(file: Path, axis: PipeAxis) -> StretchedModel:
    """Read the head of a model; parts of its buffer are read on demand.

    Raises
    ------
    InputError
        When it was not written by boresight.
    """
    with file.open("rb") as stream:
        head = stream.read(20)
        if len(head) < 20:
            raise InputError(file, "is not a binary glTF")
        magic, version, _, length, kind = struct.unpack("<5I", head)
        if (magic, version, kind) != (_GLTF, 2, _JSON) or length > _LARGEST_DOCUMENT:
            raise InputError(file, "is not a binary glTF 2.0")
        text = stream.read(length)
    with _as_written(file):
        document: Json = parse_json(text)
        if not document["meshes"][0]["primitives"]:
            raise InputError(file, "is a model without a wall")
        binary: Byte = np.memmap(file, np.uint8, "r", offset=20 + length + 8)
    return StretchedModel(file, document, binary, axis)


@contextmanager
def _as_written(file: Path) -> Iterator[None]:
    """Convert errors of missing or wrong entries in a document to an `InputError`."""
    try:
        yield
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        raise InputError(
            file, f"is not a model of boresight: {error!r}", hint="finish the run again: boresight run"
        ) from error


def _alone(document: Json, primitive: Json, binary: Byte, most: int | None) -> tuple[Json, bytes]:
    """Return a document with one primitive, its first variants and nothing else, and its buffer."""
    mappings = primitive["extensions"][_VARIANTS]["mappings"][:most]
    materials = [m["material"] for m in mappings]
    images = [_image_of(document, document["materials"][m]) for m in materials]
    used = [*primitive["attributes"].values(), primitive["indices"]]
    views = [document["accessors"][a]["bufferView"] for a in used]
    views += [document["images"][i]["bufferView"] for i in images]
    buffer, packed = _buffer(document, views, binary)
    names = list(primitive["attributes"])
    own = {
        "attributes": {name: k for k, name in enumerate(names)}, "indices": len(names), "material": 0,
        "extensions": {_VARIANTS: {"mappings": [m | {"material": k} for k, m in enumerate(mappings)]}},
    }  # fmt: skip
    kept = {k: v for k, v in document.items() if k in ("asset", "nodes", "scenes", "scene", "samplers")}
    return kept | {
        "extensions": document["extensions"], "extensionsUsed": document["extensionsUsed"],
        "meshes": [{"name": "stretch", "primitives": [primitive | own]}],
        "accessors": [document["accessors"][a] | {"bufferView": k} for k, a in enumerate(used)],
        "materials": [_with_texture(document["materials"][m], k) for k, m in enumerate(materials)],
        "textures": [{"sampler": 0, "source": k} for k in range(len(images))],
        "images": [document["images"][i] | {"bufferView": len(used) + k} for k, i in enumerate(images)],
        "bufferViews": packed, "buffers": [{"byteLength": len(buffer)}],
    }, buffer  # fmt: skip


def _image_of(document: Json, material: Json) -> int:
    texture = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    return int(document["textures"][texture]["source"])


def _with_texture(material: Json, index: int) -> Json:
    return material | {
        "pbrMetallicRoughness": material["pbrMetallicRoughness"] | {"baseColorTexture": {"index": index}}
    }


def _buffer(document: Json, views: list[int], binary: Byte) -> tuple[bytes, list[Json]]:
    """Return the bytes of views, aligned to four, and the views of the new buffer."""
    parts, packed, at = [], [], 0
    for number in views:
        view = document["bufferViews"][number]
        start = view.get("byteOffset", 0)
        part = binary[start : start + view["byteLength"]].tobytes()
        packed.append(view | {"buffer": 0, "byteOffset": at})
        parts.append(part + b"\0" * (-len(part) % 4))
        at += len(parts[-1])
    return b"".join(parts), packed


def _packed(document: Json, buffer: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(buffer)
    head = struct.pack("<3I", _GLTF, 2, total) + struct.pack("<2I", len(text), _JSON)
    return head + text + struct.pack("<2I", len(buffer), _BINARY) + buffer
