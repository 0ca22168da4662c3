"""A tileset on the disk, read only by the definitions of the formats."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pipeline.arrays import Int

Json = dict[str, Any]
FLOAT, SHORT, INT = 5126, 5123, 5125
SIZES = {"FLOAT32": "<f4", "FLOAT64": "<f8", "UINT32": "<u4"}


class Written:
    """The tree of a tileset, and its contents."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.tree: Json = json.loads((folder / "tileset.json").read_text())

    def nodes(
        self, tile: Json | None = None, parent: Json | None = None
    ) -> Iterator[tuple[Json, Json | None]]:
        tile = tile or self.tree["root"]
        yield tile, parent
        for child in tile.get("children", ()):
            yield from self.nodes(child, tile)

    def content(self, tile: Json) -> Content:
        return Content((self.folder / tile["content"]["uri"]).read_bytes())


class Content:
    """The parts of a GLB file."""

    def __init__(self, data: bytes) -> None:
        magic, version, total, length, kind = struct.unpack_from("<4s4I", data)
        assert (magic, version, total, kind) == (b"glTF", 2, len(data), 0x4E4F534A)
        assert length % 8 == 0
        assert len(data) % 8 == 4, "header of 12 and 8 + 8 of chunks: both chunks are multiples of eight"
        self.document: Json = json.loads(data[20 : 20 + length])
        size, kind = struct.unpack_from("<2I", data, 20 + length)
        assert (kind, size) == (0x004E4942, len(data) - 28 - length)
        self.binary = data[28 + length :]
        self.primitive: Json = self.document["meshes"][0]["primitives"][0]

    def view(self, number: int) -> bytes:
        view = self.document["bufferViews"][number]
        start = view.get("byteOffset", 0)
        assert start % 8 == 0
        assert start + view["byteLength"] <= self.document["buffers"][0]["byteLength"]
        return self.binary[start : start + view["byteLength"]]

    def array(self, number: int) -> NDArray[Any]:
        accessor = self.document["accessors"][number]
        kind = {FLOAT: "<f4", SHORT: "<u2", INT: "<u4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        return np.frombuffer(self.view(accessor["bufferView"]), kind).reshape(accessor["count"], width)

    def vertices_m(self) -> NDArray[Any]:
        """Return vertices as a viewer has them: node, then glTF's y up to the tileset's z up."""
        (node,) = self.document["nodes"]
        assert node["rotation"] == [1, 0, 0, 0], "half a turn about x"
        local = self.array(self.primitive["attributes"]["POSITION"]).astype(float) * [1, -1, -1]
        x, y, z = (local + node.get("translation", [0, 0, 0])).T
        return np.stack([x, -z, y], -1)

    def photo_px(self) -> int:
        """Return the number of texels of the photo."""
        material = self.document["materials"][self.primitive["material"]]
        texture = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        image = self.document["images"][self.document["textures"][texture]["source"]]
        shown = Image.open(io.BytesIO(self.view(image["bufferView"])))
        return shown.width * shown.height

    def ids(self, number: int) -> Int:
        """Return the feature of each vertex."""
        attribute = self.primitive["extensions"]["EXT_mesh_features"]["featureIds"][number]["attribute"]
        values = self.array(self.primitive["attributes"][f"_FEATURE_ID_{attribute}"]).ravel()
        assert np.all(values == np.rint(values))
        return values.astype(np.int64)

    def faces(self) -> Int:
        return self.array(self.primitive["indices"]).ravel().reshape(-1, 3).astype(np.int64)

    def table(self, number: int) -> tuple[str, list[Json]]:
        """Return the class and the rows of a property table, by the schema alone."""
        extension = self.document["extensions"]["EXT_structural_metadata"]
        table = extension["propertyTables"][number]
        properties = extension["schema"]["classes"][table["class"]]["properties"]
        assert set(table["properties"]) == set(properties)
        columns = {
            name: self._column(properties[name], at, table["count"])
            for name, at in table["properties"].items()
        }
        return table["class"], [{n: c[k] for n, c in columns.items()} for k in range(table["count"])]

    def _column(self, about: Json, at: Json, count: int) -> list[Any]:
        if about["type"] == "STRING":
            ends = np.frombuffer(self.view(at["stringOffsets"]), "<u4")
            assert len(ends) == count + 1
            text = self.view(at["values"])
            return [text[a:b].decode() for a, b in pairwise(ends)]
        values = np.frombuffer(self.view(at["values"]), SIZES[about["componentType"]])
        assert len(values) == count
        assert np.isfinite(values).all()
        return list(values.tolist())
