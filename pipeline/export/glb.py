"""model.glb: the textured mesh in metres, with photo and error colours as material variants.

glTF has +y up and looks along −z; the pipe frame has y down and z forward. The root node turns the model by
180° about x, so that 12 o'clock is up and a viewer at the start looks forward along the pipe.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray
from PIL import Image

from pipeline.arrays import Byte, Float
from pipeline.artefacts.model import VARIANTS, ErrorTexture, MeshTile, TexturedMesh
from pipeline.machine.scratch import Scratch

# Magic numbers of GLB, its JSON chunk and its binary chunk; version; largest length (glTF 2.0, section
# 4.4).
_GLTF, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_VERSION = 2
_LARGEST = (1 << 32) - 1
# EXT_structural_metadata requires eight where glTF requires four.
_ALIGNED = 8
# Bytes copied at a time.
_AT_ONCE = 1 << 24


class GlbBuilder:
    """A glTF 2.0 document under construction; its buffer lies in an unnamed file in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self.document = gltf.GLTF2()
        self.document.asset = gltf.Asset(version="2.0", generator="boresight")
        self._binary = Scratch(folder).spool(np.uint8)

    def view(self, content: bytes, target: int | None = None) -> int:
        """Append bytes, aligned, and return the number of their view."""
        views = self.document.bufferViews
        views.append(
            gltf.BufferView(buffer=0, byteOffset=self._binary.count, byteLength=len(content), target=target)
        )
        padded = content + b"\0" * (-len(content) % _ALIGNED)
        self._binary.append(np.frombuffer(padded, np.uint8))
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
        document.images.append(gltf.Image(name=name, bufferView=self.view(image), mimeType=mime))
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

    def write(self, path: Path) -> None:
        """Write the document and its buffer as GLB.

        Raises
        ------
        OSError
            When the file cannot be written, or would be longer than GLB can be.
        """
        self.document.buffers = [gltf.Buffer(byteLength=self._binary.count)]
        text = self.document.gltf_to_json().encode()
        text += b" " * (-len(text) % _ALIGNED)
        length = self._binary.count
        total = 12 + 8 + len(text) + 8 + length
        if total > _LARGEST:
            raise OSError(f"{path.name}: {total} bytes are more than a GLB can hold")
        with path.open("wb") as stream:
            stream.write(struct.pack("<5I", _GLTF, _VERSION, total, len(text), _JSON) + text)
            stream.write(struct.pack("<2I", length, _BINARY))
            for part in self._binary.parts(_AT_ONCE):
                stream.write(part.data)


HALF_TURN_ABOUT_X = [1.0, 0.0, 0.0, 0.0]
# Quality of photo textures. Chosen by eye.
_JPEG_QUALITY = 88
# Of PNG: level 9 takes twice as long as 6 for 1 to 5 % less.
_COMPRESSION = 6
_VARIANTS = "KHR_materials_variants"
_UNLIT = "KHR_materials_unlit"


def write_model(mesh: TexturedMesh, folder: Path) -> None:
    """Write ``model.glb``; tiles go to the disk one by one.

    Raises
    ------
    OSError
        When a texture cannot be encoded or the file cannot be written.
    """
    builder = GlbBuilder(folder)
    primitives = [tile_primitive(builder, tile, number) for number, tile in enumerate(mesh.tiles)]
    complete(builder, primitives)
    builder.write(folder / "model.glb")


def complete(
    builder: GlbBuilder, primitives: list[gltf.Primitive], centre_mm: Sequence[float] = (0.0, 0.0, 0.0)
) -> None:
    """Make primitives, whose positions are relative to a centre in P, the one mesh of a document."""
    document = builder.document
    document.meshes = [gltf.Mesh(name="pipe wall", primitives=primitives)]
    x, y, z = (float(c) / 1000 for c in centre_mm)
    node = gltf.Node(name="pipe", mesh=0, rotation=HALF_TURN_ABOUT_X)
    node.translation = [x, -y, -z] if any(centre_mm) else None
    document.nodes = [node]
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
    document.extensions[_VARIANTS] = {"variants": [{"name": v} for v in VARIANTS]}
    document.extensionsUsed.extend([_VARIANTS, _UNLIT])


def tile_primitive(
    builder: GlbBuilder, tile: MeshTile, number: int, centre_mm: Float | None = None
) -> gltf.Primitive:
    """Return a tile's primitive: one geometry relative to a centre, and one material for each variant."""
    place = tile.vertex_p if centre_mm is None else (tile.vertex_p - centre_mm).astype(np.float32)
    small = len(tile.vertex_p) <= np.iinfo(np.uint16).max
    index = tile.face.ravel().astype(np.uint16 if small else np.uint32)
    vertices, indices = gltf.ARRAY_BUFFER, gltf.ELEMENT_ARRAY_BUFFER
    attributes = gltf.Attributes(
        POSITION=builder.accessor(place / np.float32(1000), gltf.VEC3, gltf.FLOAT, vertices),
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


def _materials(builder: GlbBuilder, tile: MeshTile, number: int) -> Sequence[int]:
    """Return the tile's materials in the order of the variants, unlit: no viewer changes their colours."""
    errors = {e.variant: e for e in tile.errors}
    # The photo contains the light of the camera's own lamps; a viewer's light would be added to it.
    photo = builder.material(f"photo {number}", _jpeg(tile.photo_bgr), "image/jpeg", _UNLIT)
    return [
        photo,
        *(
            builder.material(f"{v} {number}", _palette_png(errors[v]), "image/png", _UNLIT)
            for v in VARIANTS[1:]
        ),
    ]


def _jpeg(bgr: Byte) -> bytes:
    good, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not good:
        raise OSError("model.glb: a photo texture cannot be encoded")
    return data.tobytes()


def _palette_png(texture: ErrorTexture) -> bytes:
    """Return a palette PNG: a third of the size of true colours."""
    picture = Image.fromarray(texture.level, mode="L")
    picture.putpalette(texture.palette_bgr[:, ::-1].tobytes())
    stream = io.BytesIO()
    picture.save(stream, "PNG", compress_level=_COMPRESSION)
    return stream.getvalue()
