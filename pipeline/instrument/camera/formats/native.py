"""The program's own camera file: the ``camera:`` section of probe.yaml, alone or with the rest."""

from __future__ import annotations

from pathlib import Path

import yaml

from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.formats.document import CameraDocument, CameraFormat
from pipeline.instrument.camera.mapping import camera_from_mapping, camera_to_mapping


def _refusal(document: CameraDocument) -> str:
    return document.lacks("camera")


def _read(document: CameraDocument) -> Camera:
    return camera_from_mapping(document.section.section("camera").values, document.file)


def _write(camera: Camera, path: Path) -> str:
    return yaml.safe_dump({"camera": camera_to_mapping(camera)}, sort_keys=False)


FORMAT = CameraFormat("boresight", _refusal, _read, _write)
