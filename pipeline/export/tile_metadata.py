"""Facts of stretches and defects as per-feature metadata of 3D Tiles 1.1.

OGC 22-025r4, "3D Tiles specification 1.1", with its 3D metadata specification (schema, binary table format);
in glTF by the extensions EXT_mesh_features and EXT_structural_metadata. Properties' names end in their unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.findings import Defect
from pipeline.artefacts.measured import RadiusMap
from pipeline.export.glb import GlbBuilder

Json = dict[str, Any]
FEATURES, METADATA = "EXT_mesh_features", "EXT_structural_metadata"
# Stands for "not measured" in tables that have no NaN; no radius is negative.
_NOT_MEASURED = -1.0
_KINDS = {"U": "UINT32", "D": "FLOAT64", "F": "FLOAT32"}
_NUMPY = {"UINT32": "<u4", "FLOAT64": "<f8", "FLOAT32": "<f4"}


@dataclass(frozen=True)
class StretchFacts:
    """Facts of a stretch of wall; −1 where nothing was measured."""

    number: int = field(metadata={"kind": "U", "says": "number of the stretch in order of distance, from 0"})
    distance_from_mm: float = field(metadata={"kind": "D", "says": "where along the pipe it begins, mm"})
    distance_to_mm: float = field(metadata={"kind": "D", "says": "where along the pipe it ends, mm"})
    mean_radius_mm: float = field(metadata={"kind": "F", "says": "mean radius, mm", "no_data": True})
    sigma_mm: float = field(
        metadata={"kind": "F", "says": "median 1 sigma of the radius, mm", "no_data": True}
    )
    coverage: float = field(metadata={"kind": "F", "says": "share of the wall that was measured, 0 to 1"})
    defects: int = field(metadata={"kind": "U", "says": "number of defects that lie on it"})


@dataclass(frozen=True)
class DefectFacts:
    """Facts of a defect."""

    number: int = field(metadata={"kind": "U", "says": "number in the list of defects"})
    defect_kind: str = field(metadata={"kind": "S", "says": "what it is"})
    distance_from_mm: float = field(metadata={"kind": "D", "says": "where along the pipe it begins, mm"})
    distance_to_mm: float = field(metadata={"kind": "D", "says": "where along the pipe it ends, mm"})
    clock_from_h: float = field(metadata={"kind": "F", "says": "first clock position, clockwise, h"})
    clock_to_h: float = field(metadata={"kind": "F", "says": "last clock position, h"})
    depth_mm: float = field(metadata={"kind": "F", "says": "extreme deviation, positive into the wall, mm"})
    depth_sigma_mm: float = field(metadata={"kind": "F", "says": "its 1 sigma, mm"})
    confidence: float = field(metadata={"kind": "F", "says": "probability that it is there and of this kind"})


_CLASSES: dict[str, type] = {"stretch": StretchFacts, "defect": DefectFacts}


def schema() -> Json:
    """Return the schema that the tileset and all of its contents share."""
    classes = {
        name: {"name": name, "description": kind.__doc__, "properties": _properties(kind)}
        for name, kind in _CLASSES.items()
    }
    return {"id": "boresight_wall", "version": "1.0.0", "classes": classes}


def stretch_facts(number: int, radius_map: RadiusMap, rows: slice, defects: Sequence[Defect]) -> StretchFacts:
    """Return the facts of some rows of the radius map."""
    s = radius_map.distance_mm[rows]
    radius, sigma = radius_map.radius_mm[rows], radius_map.sigma_mm[rows]
    seen = np.isfinite(radius)
    measured = bool(seen.any())
    return StretchFacts(
        number, float(s[0]), float(s[-1]),
        float(radius[seen].mean(dtype=np.float64)) if measured else _NOT_MEASURED,
        float(np.median(sigma[seen])) if measured else _NOT_MEASURED,
        float(seen.mean()), len(near(defects, float(s[0]), float(s[-1]))),
    )  # fmt: skip


def defect_facts(defect: Defect) -> DefectFacts:
    """Return a defect's facts."""
    return DefectFacts(
        defect.id, str(defect.kind), defect.distance_from_mm, defect.distance_to_mm, defect.clock_from,
        defect.clock_to, defect.depth_mm, defect.depth_sigma_mm, defect.confidence,
    )  # fmt: skip


def near(defects: Sequence[Defect], from_mm: float, to_mm: float) -> list[Defect]:
    """Return the defects that reach between two distances."""
    return [d for d in defects if d.distance_to_mm >= from_mm and d.distance_from_mm <= to_mm]


def defect_at(defects: Sequence[Defect], distance_mm: Float, azimuth_rad: Float) -> Int:
    """Return the index (N,) of the defect whose outline contains each place; their number if none does."""
    # matplotlib is slow to import, so it is imported only when it is needed.
    from matplotlib.path import Path as Outline

    out = np.full(len(distance_mm), len(defects))
    for number, defect in enumerate(defects):
        outline = Outline(defect.outline)
        for turn in (-2 * np.pi, 0.0, 2 * np.pi):
            out[outline.contains_points(np.stack([distance_mm, azimuth_rad + turn], -1))] = number
    return out


def facts_json(facts: StretchFacts) -> Json:
    """Return facts as the metadata of a tile."""
    return {"class": "stretch", "properties": asdict(facts)}


def add_tables(
    builder: GlbBuilder, stretches: Sequence[StretchFacts], defects: Sequence[DefectFacts]
) -> None:
    """Put the property tables of a content's features into its document."""
    tables = [_table(builder, "stretch", stretches)]
    if defects:
        tables.append(_table(builder, "defect", defects))
    builder.document.extensions[METADATA] = {"schema": schema(), "propertyTables": tables}
    builder.document.extensionsUsed.extend([FEATURES, METADATA])


def feature_ids(stretches: int, defects: int) -> Json:
    """Return the feature identifiers of a primitive: attribute 0 is the stretch, attribute 1 the defect."""
    ids: list[Json] = [{"featureCount": stretches, "attribute": 0, "propertyTable": 0, "label": "stretch"}]
    if defects:
        ids.append(
            {
                "featureCount": defects,
                "nullFeatureId": defects,
                "attribute": 1,
                "propertyTable": 1,
                "label": "defect",
            }
        )
    return {"featureIds": ids}


def _properties(kind: type) -> Json:
    out: Json = {}
    for about in fields(kind):
        name, says = about.name, about.metadata
        entry: Json = {"description": says["says"], "required": not says.get("no_data", False)}
        if says["kind"] == "S":
            entry["type"] = "STRING"
        else:
            entry |= {"type": "SCALAR", "componentType": _KINDS[says["kind"]]}
        if says.get("no_data"):
            entry["noData"] = _NOT_MEASURED
        out[name] = entry
    return out


def _table(builder: GlbBuilder, name: str, rows: Sequence[Any]) -> Json:
    properties: Json = {}
    for column, entry in _properties(_CLASSES[name]).items():
        values = [getattr(row, column) for row in rows]
        if entry["type"] == "STRING":
            properties[column] = _strings(builder, values)
        else:
            kind = _NUMPY[entry["componentType"]]
            properties[column] = {"values": builder.view(np.array(values, kind).tobytes())}
    return {"name": f"{name} table", "class": name, "count": len(rows), "properties": properties}


def _strings(builder: GlbBuilder, values: Sequence[str]) -> Json:
    encoded = [v.encode() for v in values]
    offsets = np.cumsum([0] + [len(e) for e in encoded]).astype("<u4")
    text, starts = builder.view(b"".join(encoded)), builder.view(offsets.tobytes())
    return {"values": text, "stringOffsets": starts, "stringOffsetType": "UINT32"}
