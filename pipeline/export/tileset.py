"""tileset/: the model as 3D Tiles 1.1 with levels of detail, for pipes of any length.

The stretches of the model are the leaves of a binary tree along the pipe; a parent replaces two children by a
grid and a photo half as fine. Every content is a GLB with material variants as in ``model.glb`` and with
metadata of its stretches and defects. A viewer turns glTF's +y up into the tileset's +z up.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gltf

from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.findings import Defect, Defects
from pipeline.artefacts.measured import RadiusMap, Wall, WallTexture
from pipeline.artefacts.model import MeshTile, Overlays, TexturedMesh
from pipeline.export import tile_metadata as metadata
from pipeline.export.glb import GlbBuilder, complete, tile_primitive
from pipeline.export.tile_levels import Flat, coarse_tile, flat_of, joined, shrunk
from pipeline.geometry.axis import PipeAxis, to_pipe
from pipeline.recording.base import Recording

Json = dict[str, Any]
# Number of stretches that a coarse tile distinguishes, so that its metadata stay small.
_MOST_STRETCHES = 16
# Viewers refine where an error shows as some 16 px or more; a texel counts as an error eight times as large.
_TEXELS = 8.0


def write_tileset(
    recording: Recording,
    mesh: TexturedMesh,
    wall: Wall,
    texture: WallTexture,
    overlays: Overlays,
    defects: Defects,
    folder: Path,
) -> None:
    """Write ``tileset/tileset.json`` and its contents, a folder for each level, 0 the finest.

    Raises
    ------
    OSError
        When a texture cannot be encoded or a file cannot be written.
    """
    target = folder / "tileset"
    target.mkdir()
    writer = _Writer(target, mesh, wall.radius_map, wall.axis, texture, overlays, defects.items)
    root = writer.node(0, mesh.packed.count)
    s = wall.radius_map.distance_mm
    tree: Json = {
        "asset": {"version": "1.1"},
        "schema": metadata.schema(),
        "geometricError": max(recording.pipe.nominal_diameter_mm / 1000, 2 * root.error_m),
        "metadata": metadata.facts_json(writer.facts(0, slice(0, len(s)))),
        "root": root.tile | {"refine": "REPLACE"},
    }
    (target / "tileset.json").write_text(json.dumps(tree, indent=1, allow_nan=False) + "\n")


@dataclass(frozen=True)
class _Node:
    """A tile of the tree: its error, the box (2, 3) of all below it, its level, facts and pictures."""

    tile: Json
    error_m: float
    box: Float
    level: int
    facts: metadata.StretchFacts
    flat: Flat


@dataclass(frozen=True)
class _Writer:
    """Writes contents from the leaves up, so that pictures are reduced from those just made."""

    folder: Path
    mesh: TexturedMesh
    radius_map: RadiusMap
    axis: PipeAxis
    texture: WallTexture
    overlays: Overlays
    defects: tuple[Defect, ...]

    def node(self, first: int, last: int) -> _Node:
        """Write the model's tiles ``first`` to ``last`` (exclusive) with all levels above them."""
        if last - first == 1:
            return self._leaf(first)
        middle = first + (1 << (last - first - 1).bit_length() - 1)
        return self._parent(first, last, (self.node(first, middle), self.node(middle, last)))

    def facts(self, number: int, rows: slice) -> metadata.StretchFacts:
        """Return the facts of some rows of the wall."""
        return metadata.stretch_facts(number, self.radius_map, rows, self.defects)

    def _leaf(self, number: int) -> _Node:
        tile = self.mesh.packed.tile(number)
        facts = self.facts(number, self._rows(number, number + 1))
        box = self._write(tile, np.zeros(len(tile.vertex_p), int), [facts], self._path(0, number))
        content = _tile(box, 0.0, facts, self._path(0, number), ())
        flat = flat_of(self.texture, self.overlays, facts.distance_from_mm, facts.distance_to_mm)
        return _Node(content, 0.0, box, 0, facts, flat)

    def _parent(self, first: int, last: int, children: tuple[_Node, _Node]) -> _Node:
        level = 1 + max(c.level for c in children)
        count = min(last - first, _MOST_STRETCHES)
        cuts = np.unique(np.rint(np.linspace(first, last, count + 1)).astype(int))
        rows = [self._rows(int(a), int(b)) for a, b in pairwise(cuts)]
        texel_mm = self.mesh.texel_mm * 2**level
        flat = joined([self._shrunk(c, level, texel_mm) for c in children])
        borders = [r.start for r in rows] + [rows[-1].stop - 1]
        coarse = coarse_tile(self.radius_map, self.axis, borders, 2 ** (level + 1), flat, self.overlays)
        path = self._path(level, first >> level)
        facts = [self.facts(int(n), r) for n, r in zip(cuts[:-1], rows, strict=True)]
        own = self._write(coarse.tile, coarse.stretch, facts, path) if len(coarse.tile.face) else None
        box = _union([c.box for c in children] + ([own] if own is not None else []))
        error = max((coarse.error_mm + _TEXELS * texel_mm) / 1000, *(c.error_m for c in children))
        whole = self.facts(first, slice(rows[0].start, rows[-1].stop))
        tile = _tile(box, error, whole, path if own is not None else "", [c.tile for c in children])
        return _Node(tile, error, box, level, whole, flat)

    def _rows(self, first: int, last: int) -> slice:
        """Return the rows of the map from the beginning of a tile to that of the next, both included."""
        s, place = self.radius_map.distance_mm, self.mesh.packed.distance_mm
        end = place[last, 0] if last < len(place) else place[-1, 1]
        step = (s[-1] - s[0]) / max(len(s) - 1, 1)
        a, b = np.rint((np.array([place[first, 0], end]) - s[0]) / step).astype(int)
        a = int(np.clip(a, 0, len(s) - 2))
        return slice(a, int(np.clip(b, a + 1, len(s) - 1)) + 1)

    def _shrunk(self, node: _Node, level: int, texel_mm: float) -> Flat:
        """Return a node's pictures for a node at a higher level."""
        around_mm = self.texture.bgra.shape[1] * self.texture.mm_per_px
        length_mm = node.facts.distance_to_mm - node.facts.distance_from_mm
        size = round(around_mm / texel_mm), round(length_mm / texel_mm)
        return shrunk(node.flat, *size, 2 ** (level - node.level))

    def _path(self, level: int, number: int) -> str:
        return f"{level}/{number:05d}.glb"

    def _write(
        self, tile: MeshTile, stretch: Int, facts: Sequence[metadata.StretchFacts], path: str
    ) -> Float:
        """Write a content; return its box (2, 3) in the tileset's coordinates, m."""
        file = self.folder / path
        file.parent.mkdir(exist_ok=True)
        defects = metadata.near(self.defects, *tile.distance_mm)
        builder = GlbBuilder(self.folder)
        centre = np.rint(tile.vertex_p.mean(axis=0, dtype=np.float64))
        primitive = tile_primitive(builder, tile, 0, centre)
        s, psi, _ = to_pipe(self.axis, tile.vertex_p.astype(float))
        names = [stretch, metadata.defect_at(defects, s, psi)] if defects else [stretch]
        for k, ids in enumerate(names):
            place = builder.accessor(ids.astype(np.float32), gltf.SCALAR, gltf.FLOAT, gltf.ARRAY_BUFFER)
            setattr(primitive.attributes, f"_FEATURE_ID_{k}", place)
        primitive.extensions[metadata.FEATURES] = metadata.feature_ids(len(facts), len(defects))
        complete(builder, [primitive], tuple(centre))
        metadata.add_tables(builder, facts, [metadata.defect_facts(d) for d in defects])
        builder.write(file)
        return _box(tile.vertex_p)


def _box(vertex_p: Float32) -> Float:
    """Return lower and upper corner (2, 3), m; P's z is the tileset's y, P's −y its z."""
    x, y, z = vertex_p.astype(float).T / 1000
    place = np.stack([x, z, -y], -1)
    # Contents hold single precision: a micrometre about them holds every vertex.
    return np.stack([place.min(0) - 1e-6, place.max(0) + 1e-6])


def _union(boxes: Sequence[Float]) -> Float:
    return np.stack([np.min([b[0] for b in boxes], 0), np.max([b[1] for b in boxes], 0)])


def _tile(
    box: Float, error_m: float, facts: metadata.StretchFacts, path: str, children: Sequence[Json]
) -> Json:
    centre, half = (box[0] + box[1]) / 2, (box[1] - box[0]) / 2
    tile: Json = {
        "boundingVolume": {"box": [*centre.tolist(), *np.diag(half).ravel().tolist()]},
        "geometricError": error_m,
        "metadata": metadata.facts_json(facts),
    }
    if path:
        tile["content"] = {"uri": path}
    if children:
        tile["children"] = list(children)
    return tile
