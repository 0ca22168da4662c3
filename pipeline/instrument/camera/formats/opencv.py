"""OpenCV's calibration YAML (``cv2.FileStorage``), pinhole and fisheye, and ROS's camera_info YAML."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pipeline.files.json_yaml import Section
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.fisheye import Equidistant, KannalaBrandt
from pipeline.instrument.camera.formats.document import CameraDocument, CameraFormat, cannot_hold
from pipeline.instrument.camera.mapping import number_list, positive, side
from pipeline.instrument.camera.plumb_bob import Pinhole

_MATRIX_KEYS = ("camera_matrix", "K", "cameraMatrix")
_DISTORTION_KEYS = ("distortion_coefficients", "D", "distCoeffs", "dist_coeffs")
_FISHEYE = {"equidistant": True, "fisheye": True, "plumb_bob": False, "radtan": False}
# OpenCV's longest model has 14 coefficients.
_MOST_COEFFICIENTS = 14


def _present(section: Section, keys: tuple[str, ...]) -> str:
    return next((key for key in keys if key in section.values), "")


def _refusal(document: CameraDocument) -> str:
    if isinstance(document.yaml, str):
        return document.yaml
    for keys in (_MATRIX_KEYS, _DISTORTION_KEYS):
        if not _present(document.yaml, keys):
            return f"has none of the keys {', '.join(keys)}"
    return ""


def _read(document: CameraDocument) -> Camera:
    section = document.section
    size = side(section, "image_width"), side(section, "image_height")
    focal, centre = _focal_and_centre(section)
    coefficients = _coefficients(section)
    if _is_fisheye(section, coefficients):
        k1, k2, k3, k4 = _cut(section, coefficients, 4)
        return KannalaBrandt(size, focal, centre, (k1, k2, k3, k4))
    k1, k2, p1, p2, k3 = _cut(section, coefficients, 5)
    return Pinhole(size, focal, centre, (k1, k2, p1, p2, k3))


def _focal_and_centre(section: Section) -> tuple[tuple[float, float], tuple[float, float]]:
    key = _present(section, _MATRIX_KEYS)
    matrix = section.section(key)
    values = matrix.numbers("data", 9)
    fx, skew, cx, zero, fy, cy, *last = values
    positive(matrix, "data", (fx, fy))
    if (skew, zero, *last) != (0, 0, 0, 0, 1):
        raise matrix.fail("data", "is not a camera matrix", "[fx, 0, cx, 0, fy, cy, 0, 0, 1]")
    return (fx, fy), (cx, cy)


def _coefficients(section: Section) -> tuple[float, ...]:
    return number_list(section.section(_present(section, _DISTORTION_KEYS)), "data", 4, _MOST_COEFFICIENTS)


def _is_fisheye(section: Section, coefficients: tuple[float, ...]) -> bool:
    """Return whether the file states the fisheye model; four coefficients alone may be of either model."""
    if section.has("fisheye_model"):
        flag = section.require("fisheye_model", "0 or 1")
        if flag not in (0, 1):
            raise section.fail("fisheye_model", f"is {flag!r}", "0 or 1")
        return bool(flag)
    if section.has("distortion_model"):
        return _FISHEYE[section.choice("distortion_model", tuple(_FISHEYE))]
    if len(coefficients) == 4:
        raise section.fail(
            _present(section, _DISTORTION_KEYS),
            "holds four coefficients, which both OpenCV's fisheye and its pinhole model have",
            "five coefficients, or the key fisheye_model",
            "add the line 'fisheye_model: 1' for a fisheye, 'fisheye_model: 0' for a pinhole calibration",
        )
    return False


def _cut(section: Section, coefficients: tuple[float, ...], count: int) -> tuple[float, ...]:
    """Return ``count`` coefficients; further ones must be zero, absent ones are zero."""
    if any(coefficients[count:]):
        raise section.fail(
            _present(section, _DISTORTION_KEYS),
            f"holds {len(coefficients)} coefficients",
            f"{count}: rational, thin-prism and tilted models are not known here",
            "calibrate with the model kannala_brandt or unified instead",
        )
    return (coefficients + (0.0,) * count)[:count]


def _write(camera: Camera, path: Path) -> str:
    match camera:
        case KannalaBrandt():
            fisheye, distortion = 1, tuple(camera.distortion)
        case Equidistant():
            fisheye, distortion = 1, (0.0,) * 4
        case Pinhole():
            fisheye, distortion = 0, tuple(camera.distortion)
        case _:
            raise cannot_hold(camera, path, "OpenCV's file", "kannala_brandt, equidistant or pinhole")
    matrix = np.diag([*camera.focal_px, 1.0])
    matrix[:2, 2] = camera.centre
    storage = cv2.FileStorage(
        "", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
    )
    storage.write("image_width", int(camera.image_size[0]))
    storage.write("image_height", int(camera.image_size[1]))
    storage.write("fisheye_model", fisheye)
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", np.array(distortion)[:, None])
    return str(storage.releaseAndGetString())


FORMAT = CameraFormat("opencv", _refusal, _read, _write)
