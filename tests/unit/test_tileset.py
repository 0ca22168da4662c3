"""tileset/: every content can be read; boxes contain it, children refine, metadata follow the schema."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.artefacts.findings import Defect, Defects
from pipeline.artefacts.measured import Wall
from pipeline.artefacts.model import VARIANTS, TexturedMesh
from pipeline.export.tileset import write_tileset
from stages.mesh import MeshParameters, make_mesh
from stages.overlays import OverlayParameters, overlays_of
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording
from tests.unit.small_wall import PIT, RADIUS, small_wall, smooth_photo
from tests.unit.tileset_reader import SIZES, Json, Written

TILES = 5


def pit_defect() -> Defect:
    """Return the drawn pit as a defect, its outline an ellipse."""
    at, around, depth, width = PIT
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    outline = np.stack([at + width * np.cos(turn), around + width / RADIUS * np.sin(turn)], -1)
    return Defect(
        7, "corrosion", at - width, at + width, 4.5, 5.5, at, 5.0, 2 * width, 2 * width, depth, 0.02,
        float("nan"), 1.0, 0.9, np.arange(3), outline, "", "", "", "drawn",
    )  # fmt: skip


@pytest.fixture(scope="module")
def wall() -> Wall:
    return small_wall(noise_mm=0.01, hole=(slice(0, 30), slice(60, 100)))


@pytest.fixture(scope="module")
def mesh(wall: Wall) -> TexturedMesh:
    overlays = overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters())
    return make_mesh(wall, smooth_photo(), overlays, MeshParameters(tile_mm=10.0), quiet_context())


@pytest.fixture(scope="module")
def written(wall: Wall, mesh: TexturedMesh, tmp_path_factory: pytest.TempPathFactory) -> Written:
    folder = tmp_path_factory.mktemp("run")
    write(wall, mesh, folder)
    return Written(folder / "tileset")


def write(wall: Wall, mesh: TexturedMesh, folder: Path) -> None:
    overlays = overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters())
    defects = Defects((pit_defect(),), 0.1)
    write_tileset(bare_recording(2 * RADIUS), mesh, wall, smooth_photo(), overlays, defects, folder)


def box_of(tile: Json) -> NDArray[Any]:
    box = np.array(tile["boundingVolume"]["box"])
    half = box[3:].reshape(3, 3)
    assert np.all(half[~np.eye(3, dtype=bool)] == 0)
    return np.stack([box[:3] - np.diag(half), box[:3] + np.diag(half)])


def test_the_tree_follows_the_standard(written: Written) -> None:
    tree = written.tree
    assert tree["asset"] == {"version": "1.1"}
    assert tree["root"]["refine"] == "REPLACE"
    assert tree["geometricError"] > tree["root"]["geometricError"]
    leaves = [tile for tile, _ in written.nodes() if not tile.get("children")]
    assert len(leaves) == TILES
    assert all(tile["geometricError"] == 0 for tile in leaves)
    files = {p.relative_to(written.folder).as_posix() for p in written.folder.rglob("*.glb")}
    assert files == {tile["content"]["uri"] for tile, _ in written.nodes()}


def holds(outer: NDArray[Any], inner: NDArray[Any]) -> bool:
    return bool(np.all(inner >= outer[0] - 1e-12) and np.all(inner <= outer[1] + 1e-12))


def test_boxes_contain_their_contents_and_their_children(written: Written) -> None:
    for tile, parent in written.nodes():
        box, vertex = box_of(tile), written.content(tile).vertices_m()
        assert holds(box, vertex), tile["content"]["uri"]
        middle = box.mean(0)
        assert not holds(middle + 0.99 * (box - middle), vertex), "control: no box is larger than necessary"
        if parent is not None:
            assert holds(box_of(parent), box)


def test_the_pipe_runs_along_y_with_twelve_oclock_up(written: Written) -> None:
    vertex = written.content(written.tree["root"]).vertices_m()
    assert np.ptp(vertex[:, 1]) == pytest.approx(0.05, abs=1e-4)
    (leaf,) = (t for t, _ in written.nodes() if not t.get("children") and lies_in(PIT[0], t))
    vertex = written.content(leaf).vertices_m()
    deepest = vertex[np.argmax(np.hypot(vertex[:, 0], vertex[:, 2]))]
    # Azimuth 1 rad of P, whose y points down: right of and below the middle.
    assert deepest[0] > 0 > deepest[2]


def test_children_refine_their_parent(written: Written) -> None:
    for tile, parent in written.nodes():
        if parent is None:
            continue
        assert tile["geometricError"] < parent["geometricError"]
        stretch = tile["metadata"]["properties"]
        outer = parent["metadata"]["properties"]
        assert outer["distance_from_mm"] <= stretch["distance_from_mm"]
        assert outer["distance_to_mm"] >= stretch["distance_to_mm"]
        density = [written.content(t).photo_px() / length(t) for t in (tile, parent)]
        assert density[0] > 1.5 * density[1]
    for tile, _ in written.nodes():
        spans = [c["metadata"]["properties"] for c in tile.get("children", ())]
        for before, after in pairwise(spans):
            assert before["distance_to_mm"] == after["distance_from_mm"]


def lies_in(distance_mm: float, tile: Json) -> bool:
    stretch = tile["metadata"]["properties"]
    return bool(stretch["distance_from_mm"] < distance_mm < stretch["distance_to_mm"])


def length(tile: Json) -> float:
    stretch = tile["metadata"]["properties"]
    return float(stretch["distance_to_mm"] - stretch["distance_from_mm"])


def test_metadata_follow_the_one_schema(written: Written) -> None:
    schema = written.tree["schema"]
    for tile, _ in written.nodes():
        extension = written.content(tile).document["extensions"]["EXT_structural_metadata"]
        assert extension["schema"] == schema
        about = schema["classes"][tile["metadata"]["class"]]["properties"]
        values = tile["metadata"]["properties"]
        assert set(values) == set(about)
        assert {n for n, a in about.items() if a["required"]} <= set(values)
    for kind in schema["classes"].values():
        for about in kind["properties"].values():
            assert (about["type"], about.get("componentType")) in {
                ("STRING", None), *(("SCALAR", size) for size in SIZES)
            }  # fmt: skip


def test_every_triangle_belongs_to_one_stretch_and_lies_in_it(written: Written) -> None:
    for tile, _ in written.nodes():
        content = written.content(tile)
        kind, rows = content.table(0)
        ids, faces = content.ids(0), content.faces()
        assert kind == "stretch"
        (first, *_) = content.primitive["extensions"]["EXT_mesh_features"]["featureIds"]
        assert first["featureCount"] == len(rows)
        assert set(ids) <= set(range(len(rows)))
        assert np.all(ids[faces] == ids[faces][:, :1])
        along = 1000 * content.vertices_m()[:, 1]
        low, high = (np.array([r[n] for r in rows])[ids] for n in ("distance_from_mm", "distance_to_mm"))
        assert np.all((along > low - 0.3) & (along < high + 0.3))


def test_the_properties_of_stretches_agree_with_the_map(written: Written, wall: Wall) -> None:
    s, radius = wall.radius_map.distance_mm, wall.radius_map.radius_mm
    leaves = [tile for tile, _ in written.nodes() if not tile.get("children")]
    for tile in leaves:
        stretch = tile["metadata"]["properties"]
        inside = (s >= stretch["distance_from_mm"] - 1e-6) & (s <= stretch["distance_to_mm"] + 1e-6)
        assert stretch["mean_radius_mm"] == pytest.approx(np.nanmean(radius[inside]), abs=1e-3)
        assert stretch["coverage"] == pytest.approx(np.isfinite(radius[inside]).mean(), abs=1e-6)
        assert stretch["sigma_mm"] == pytest.approx(0.05, abs=1e-3)
    assert min(t["metadata"]["properties"]["coverage"] for t in leaves) < 0.95, "the stretch with the hole"
    assert sum(t["metadata"]["properties"]["defects"] for t in leaves) >= 1


def test_a_defect_is_found_at_its_place(written: Written) -> None:
    at, around, _, width = PIT
    found = 0
    for tile, _ in written.nodes():
        content = written.content(tile)
        named = content.primitive["extensions"]["EXT_mesh_features"]["featureIds"]
        assert len(named) == 1 + (tile["metadata"]["properties"]["defects"] > 0)
        if len(named) == 1:
            continue
        kind, rows = content.table(1)
        assert (kind, rows[0]["number"], rows[0]["defect_kind"]) == ("defect", 7, "corrosion")
        ids, vertex = content.ids(1), 1000 * content.vertices_m()
        assert named[1]["nullFeatureId"] == len(rows)
        psi = np.arctan2(-vertex[:, 2], vertex[:, 0])
        off = np.hypot(vertex[:, 1] - at, RADIUS * (psi - around)) / width
        assert np.all(off[ids == 0] < 1.05)
        assert np.all(off[ids == 1] > 0.95)
        found += int(np.sum(ids == 0))
    assert found > 10


def test_levels_are_as_near_to_the_wall_as_stated(written: Written, wall: Wall) -> None:
    radius_map = wall.radius_map
    for tile, _ in written.nodes():
        if not tile.get("children"):
            continue
        vertex = 1000 * written.content(tile).vertices_m()
        row = np.rint((vertex[:, 1] - radius_map.distance_mm[0]) / 0.5).astype(int)
        column = np.rint((np.arctan2(-vertex[:, 2], vertex[:, 0]) + np.pi) / (2 * np.pi) * 360).astype(int)
        measured = radius_map.radius_mm[row, column % 360]
        off = np.abs(np.hypot(vertex[:, 0], vertex[:, 2]) - measured) / 1000
        assert np.nanmax(off) < tile["geometricError"]


def test_every_level_has_every_variant(written: Written) -> None:
    for tile, _ in written.nodes():
        document = written.content(tile).document
        names = [v["name"] for v in document["extensions"]["KHR_materials_variants"]["variants"]]
        assert tuple(names) == VARIANTS
        assert set(document["extensionsUsed"]) >= {"EXT_mesh_features", "EXT_structural_metadata"}


def test_the_same_wall_gives_the_same_bytes(
    written: Written, wall: Wall, mesh: TexturedMesh, tmp_path: Path
) -> None:
    write(wall, mesh, tmp_path)
    for file in written.folder.rglob("*.*"):
        again = tmp_path / "tileset" / file.relative_to(written.folder)
        assert again.read_bytes() == file.read_bytes(), file.name
