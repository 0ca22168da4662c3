"""model.glb: the textured mesh in metres, with photo and error colours as material variants.

glTF has +y up and looks along −z; the pipe frame has y down and z forward. The root node turns the model by
180° about x, so that 12 o'clock is up and a viewer at the start looks forward along the pipe.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray
from PIL import Image

from pipeline.model import VARIANTS, ErrorTexture, MeshTile, TexturedMesh

_HALF_TURN_ABOUT_X = [1.0, 0.0, 0.0, 0.0]
_JPEG_QUALITY = 88
_VARIANTS = "KHR_materials_variants"
_UNLIT = "KHR_materials_unlit"


def write_model(mesh: TexturedMesh, folder: Path) -> None:
    """Write ``model.glb``.

    Raises
    ------
    OSError
        When a texture cannot be encoded or the file cannot be written.
    """
    (folder / "model.glb").write_bytes(model_bytes(mesh))


def model_bytes(mesh: TexturedMesh) -> bytes:
    """Return the model as binary glTF 2.0."""
    builder = _Builder()
    primitives = [_primitive(builder, tile, number) for number, tile in enumerate(mesh.tiles)]
    document = builder.document
    document.asset = gltf.Asset(version="2.0", generator="boresight")
    document.meshes = [gltf.Mesh(name="pipe wall", primitives=primitives)]
    document.nodes = [gltf.Node(name="pipe", mesh=0, rotation=_HALF_TURN_ABOUT_X)]
    document.scenes = [gltf.Scene(name="pipe", nodes=[0])]
    document.scene = 0
    document.samplers = [
        gltf.Sampler(
            magFilter=gltf.LINEAR,
            minFilter=gltf.LINEAR_MIPMAP_LINEAR,
            wrapS=gltf.CLAMP_TO_EDGE,
            wrapT=gltf.CLAMP_TO_EDGE,
        )
    ]
    document.extensions = {_VARIANTS: {"variants": [{"name": v} for v in VARIANTS]}}
    document.extensionsUsed = [_VARIANTS, _UNLIT]
    return builder.finish()


class _Builder:
    """Collects a document's arrays and images in one binary buffer."""

    def __init__(self) -> None:
        self.document = gltf.GLTF2()
        self._parts: list[bytes] = []
        self._length = 0

    def view(self, content: bytes, target: int | None) -> int:
        """Append bytes, aligned to four, and return the number of their view."""
        views = self.document.bufferViews
        views.append(
            gltf.BufferView(buffer=0, byteOffset=self._length, byteLength=len(content), target=target)
        )
        padded = content + b"\0" * (-len(content) % 4)
        self._parts.append(padded)
        self._length += len(padded)
        return len(views) - 1

    def accessor(self, values: NDArray[Any], kind: str, component: int, target: int) -> int:
        """Append an array and return the number of its accessor."""
        bounds = values.reshape(len(values), -1)
        accessor = gltf.Accessor(
            bufferView=self.view(np.ascontiguousarray(values).tobytes(), target),
            componentType=component,
            count=len(values),
            type=kind,
            min=bounds.min(axis=0).tolist(),
            max=bounds.max(axis=0).tolist(),
        )
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1

    def material(self, name: str, image: bytes, mime: str, *extensions: str) -> int:
        """Append a matt, two-sided material with a base colour picture and return its number."""
        document = self.document
        document.images.append(gltf.Image(name=name, bufferView=self.view(image, None), mimeType=mime))
        document.textures.append(gltf.Texture(sampler=0, source=len(document.images) - 1))
        colour = gltf.PbrMetallicRoughness(
            baseColorTexture=gltf.TextureInfo(index=len(document.textures) - 1),
            metallicFactor=0.0,
            roughnessFactor=1.0,
        )
        material = gltf.Material(name=name, pbrMetallicRoughness=colour, doubleSided=True)
        material.extensions = {e: {} for e in extensions}
        material.alphaCutoff = None
        document.materials.append(material)
        return len(document.materials) - 1

    def finish(self) -> bytes:
        """Return the document with its buffer as GLB."""
        self.document.buffers = [gltf.Buffer(byteLength=self._length)]
        self.document.set_binary_blob(b"".join(self._parts))
        return b"".join(self.document.save_to_bytes())


def _primitive(builder: _Builder, tile: MeshTile, number: int) -> gltf.Primitive:
    """Return a tile's primitive: one geometry, a material for each variant."""
    small = len(tile.vertex_p) <= np.iinfo(np.uint16).max
    index = tile.face.ravel().astype(np.uint16 if small else np.uint32)
    vertices, indices = gltf.ARRAY_BUFFER, gltf.ELEMENT_ARRAY_BUFFER
    attributes = gltf.Attributes(
        POSITION=builder.accessor(tile.vertex_p / np.float32(1000), gltf.VEC3, gltf.FLOAT, vertices),
        NORMAL=builder.accessor(tile.normal_p, gltf.VEC3, gltf.FLOAT, vertices),
        TEXCOORD_0=builder.accessor(tile.uv, gltf.VEC2, gltf.FLOAT, vertices),
    )
    component = gltf.UNSIGNED_SHORT if small else gltf.UNSIGNED_INT
    corner = builder.accessor(index, gltf.SCALAR, component, indices)
    materials = _materials(builder, tile, number)
    mappings = [{"material": m, "variants": [v]} for v, m in enumerate(materials)]
    primitive = gltf.Primitive(
        attributes=attributes, indices=corner, material=materials[0], mode=gltf.TRIANGLES
    )
    primitive.extensions = {_VARIANTS: {"mappings": mappings}}
    return primitive


def _materials(builder: _Builder, tile: MeshTile, number: int) -> Sequence[int]:
    """Return the tile's materials in the order of the variants; error colours are unlit, hence true."""
    errors = {e.variant: e for e in tile.errors}
    photo = builder.material(f"photo {number}", _jpeg(tile.photo_bgr), "image/jpeg")
    return [
        photo,
        *(
            builder.material(f"{v} {number}", _palette_png(errors[v]), "image/png", _UNLIT)
            for v in VARIANTS[1:]
        ),
    ]


def _jpeg(bgr: NDArray[np.uint8]) -> bytes:
    good, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not good:
        raise OSError("model.glb: a photo texture cannot be encoded")
    return data.tobytes()


def _palette_png(texture: ErrorTexture) -> bytes:
    """Return a palette PNG: a third of the size of true colours."""
    picture = Image.fromarray(texture.level, mode="L")
    picture.putpalette(texture.palette_bgr[:, ::-1].tobytes())
    stream = io.BytesIO()
    picture.save(stream, "PNG", compress_level=9)
    return stream.getvalue()
