"""glTF documents put together piece by piece: arrays and pictures go to one binary buffer on the disk."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray

from pipeline.machine.scratch import Scratch

_GLTF, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_VERSION = 2
_LARGEST = (1 << 32) - 1
# EXT_structural_metadata asks for eight where glTF asks for four.
_ALIGNED = 8
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
