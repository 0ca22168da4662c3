"""model.glb, cloud.ply and the pictures of overlays, read back with other libraries."""

import io
from pathlib import Path

import cv2
import numpy as np
import pygltflib
import pytest
from PIL import Image
from plyfile import PlyData

from pipeline.artefacts.measured import Wall
from pipeline.artefacts.model import VARIANTS, TexturedMesh
from pipeline.export.arrays import write_cloud
from pipeline.export.glb import write_model
from pipeline.export.pictures import write_overlays
from stages.mesh import MeshParameters, make_mesh
from stages.overlays import OverlayParameters, overlays_of
from tests.model_picture import inside_view, render
from tests.quiet import quiet_context
from tests.unit.small_wall import PIT, RADIUS, small_wall, smooth_photo


@pytest.fixture(scope="module")
def wall() -> Wall:
    return small_wall(length_mm=30.0, noise_mm=0.01)


@pytest.fixture(scope="module")
def mesh(wall: Wall) -> TexturedMesh:
    overlays = overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters())
    return make_mesh(wall, smooth_photo(), overlays, MeshParameters(tile_mm=15.0), quiet_context())


def array(document: pygltflib.GLTF2, number: int, kind: type, width: int) -> np.ndarray:
    accessor = document.accessors[number]
    view = document.bufferViews[accessor.bufferView]
    flat = np.frombuffer(document.binary_blob(), kind, accessor.count * width, view.byteOffset)
    return flat.reshape(accessor.count, width)


def picture(document: pygltflib.GLTF2, material: int) -> np.ndarray:
    texture = document.materials[material].pbrMetallicRoughness.baseColorTexture.index
    view = document.bufferViews[document.images[document.textures[texture].source].bufferView]
    data = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def test_the_model_is_in_metres_with_twelve_oclock_up(mesh: TexturedMesh, tmp_path: Path) -> None:
    write_model(mesh, tmp_path)
    document = pygltflib.GLTF2().load(str(tmp_path / "model.glb"))
    assert document.scene == 0
    assert document.nodes[document.scenes[0].nodes[0]].rotation == [1.0, 0.0, 0.0, 0.0]
    for primitive, tile in zip(document.meshes[0].primitives, mesh.tiles, strict=True):
        position = array(document, primitive.attributes.POSITION, np.float32, 3)
        np.testing.assert_allclose(1000 * position, tile.vertex_p, atol=1e-4)
        # A half turn about x takes y down to y up: (x, y, z) -> (x, -y, -z).
        turned = position * [1, -1, -1]
        crown = tile.vertex_p[:, 1] < -0.9 * RADIUS
        assert np.all(turned[crown, 1] > 0)
        index = array(document, primitive.indices, np.uint16, 1).ravel()
        assert np.array_equal(index.reshape(-1, 3), tile.face)
        normal = array(document, primitive.attributes.NORMAL, np.float32, 3)
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-3)
        assert np.all(np.sum(normal[:, :2] * position[:, :2], axis=1) < 0)
        accessor = document.accessors[primitive.attributes.POSITION]
        np.testing.assert_array_equal(np.float32(accessor.min), position.min(axis=0))
        np.testing.assert_array_equal(np.float32(accessor.max), position.max(axis=0))


def test_every_tile_has_all_variants_with_one_uv_map(mesh: TexturedMesh, tmp_path: Path) -> None:
    write_model(mesh, tmp_path)
    document = pygltflib.GLTF2().load(str(tmp_path / "model.glb"))
    assert set(document.extensionsUsed) == {"KHR_materials_variants", "KHR_materials_unlit"}
    names = [v["name"] for v in document.extensions["KHR_materials_variants"]["variants"]]
    assert tuple(names) == VARIANTS
    for primitive, tile in zip(document.meshes[0].primitives, mesh.tiles, strict=True):
        mappings = primitive.extensions["KHR_materials_variants"]["mappings"]
        by_variant = {names[v]: m["material"] for m in mappings for v in m["variants"]}
        assert set(by_variant) == set(VARIANTS)
        assert primitive.material == by_variant["photo"]
        assert "KHR_materials_unlit" in document.materials[by_variant["photo"]].extensions
        assert (
            np.abs(picture(document, by_variant["photo"])[..., ::-1].astype(int) - tile.photo_bgr).mean() < 4
        )
        for error in tile.errors:
            assert "KHR_materials_unlit" in document.materials[by_variant[error.variant]].extensions
            shown = picture(document, by_variant[error.variant])
            np.testing.assert_array_equal(shown[..., ::-1], error.palette_bgr[error.level])


def test_buffer_views_are_aligned_and_inside_the_buffer(mesh: TexturedMesh, tmp_path: Path) -> None:
    write_model(mesh, tmp_path)
    document = pygltflib.GLTF2().load(str(tmp_path / "model.glb"))
    length = document.buffers[0].byteLength
    for view in document.bufferViews:
        assert view.byteOffset % 4 == 0
        assert view.byteOffset + view.byteLength <= length


def test_cloud_has_the_agreed_properties(wall: Wall, tmp_path: Path) -> None:
    photo = smooth_photo()
    write_cloud(wall, photo, tmp_path)
    ply = PlyData.read(tmp_path / "cloud.ply")
    assert not ply.text
    assert ply.byte_order == "<"
    points = ply["vertex"]
    names = ",".join(p.name for p in points.properties)
    assert names == "x,y,z,nx,ny,nz,red,green,blue,sigma_mm,radius_mm,distance_mm,azimuth_rad,frame"
    cloud = wall.cloud
    np.testing.assert_array_equal(np.stack([points[a] for a in "xyz"], -1), cloud.xyz_p)
    for name in ("sigma_mm", "radius_mm", "distance_mm", "azimuth_rad", "frame"):
        np.testing.assert_array_equal(points[name], getattr(cloud, name))
    blue = np.asarray(points["blue"], float)
    assert np.abs(blue - (60 + 2 * (cloud.distance_mm - photo.distance_from_mm))).max() < 3


def test_cloud_is_grey_where_there_is_no_photo(wall: Wall, tmp_path: Path) -> None:
    write_cloud(wall, smooth_photo(distance_from_mm=10.0), tmp_path)
    points = PlyData.read(tmp_path / "cloud.ply")["vertex"]
    before = np.asarray(points["distance_mm"]) < 9.5
    assert np.all(np.asarray(points["green"])[before] == 128)
    assert np.ptp(np.asarray(points["green"])[~before]) > 50


def test_overlay_pictures_are_written(wall: Wall, tmp_path: Path) -> None:
    write_overlays(overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters()), tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {
        "deviation.png", "deviation_nominal.png", "uncertainty.png", "misalignment.png",
    }  # fmt: skip
    picture = cv2.imread(str(tmp_path / "deviation.png"))
    assert picture.shape[0] >= 500
    # The pit is a loss of wall: dark red somewhere.
    blue, _, red = picture.reshape(-1, 3).astype(int).T
    assert np.count_nonzero((red - blue > 80) & (red < 200)) > 20


def test_the_picture_from_inside_shows_wall_around_an_opening(mesh: TexturedMesh) -> None:
    shown = render(mesh, inside_view(mesh), 160, 120)
    assert shown.shape == (120, 160, 3)
    assert shown[:20].mean() > 60
    assert shown[55:65, 75:85].mean() < 50


def test_an_overlay_picture_shows_the_pit_at_its_distance_and_clock(wall: Wall, tmp_path: Path) -> None:
    overlays = overlays_of(wall.radius_map, 2 * RADIUS, OverlayParameters())
    write_overlays(overlays, tmp_path)
    figure = cv2.imread(str(tmp_path / "deviation.png"))
    flat = figure[49:527, 91:809]  # within the frame of a wall of 720 by 480 px
    assert np.all(figure[48, 90:810] == 0)
    assert figure[60:516, 805:815].mean((0, 2)).argmin() in (4, 5), "the frame's right side, between two dots"
    blue, _, red = np.moveaxis(flat.astype(int), 2, 0)
    row, column = (np.mean(x) for x in np.nonzero((red - blue > 80) & (red < 200)))
    distance = overlays.distance_mm
    at_mm = distance[0] + column / flat.shape[1] * np.ptp(distance)
    hours = 6 - 12 * row / flat.shape[0]
    pit_mm, pit_rad = PIT[:2]
    clock = (np.degrees(pit_rad) + 90) / 30
    assert at_mm == pytest.approx(pit_mm, abs=0.5)
    assert hours == pytest.approx((clock + 6) % 12 - 6, abs=0.1)
