"""Kalibr's camchain YAML: pinhole-equi, pinhole-radtan and omni-radtan, one camera a file."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from pipeline.errors import InputError
from pipeline.files.yaml_file import Section
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.equidistant import Equidistant
from pipeline.instrument.camera.formats.document import CameraDocument, CameraFormat, cannot_hold
from pipeline.instrument.camera.kannala_brandt import KannalaBrandt
from pipeline.instrument.camera.pinhole import Pinhole
from pipeline.instrument.camera.section_values import image_size, positive
from pipeline.instrument.camera.unified import Unified


def _cameras(section: Section) -> list[str]:
    return [str(key) for key in section.values if re.fullmatch(r"cam[0-9]+", str(key))]


def _refusal(document: CameraDocument) -> str:
    if isinstance(document.yaml, str):
        return document.yaml
    return "" if _cameras(document.yaml) else "has no key 'cam0'"


def _read(document: CameraDocument) -> Camera:
    names = _cameras(document.section)
    if len(names) > 1:
        raise InputError(
            document.file,
            f"holds {len(names)} cameras: {', '.join(names)}",
            expected="one camera",
            hint="copy the one that is meant to a file of its own",
        )
    section = document.section.section(names[0])
    model = section.choice("camera_model", ("pinhole", "omni"))
    return _omni(section) if model == "omni" else _pinhole(section)


def _omni(section: Section) -> Camera:
    section.choice("distortion_model", ("radtan",))
    xi, fx, fy, cx, cy = section.numbers("intrinsics", 5)
    positive(section, "intrinsics", (fx, fy))
    if xi < 0:
        raise section.fail("intrinsics[0]", f"is {xi:g}", "a mirror parameter of at least 0")
    return Unified(image_size(section, "resolution"), xi, (fx, fy), (cx, cy), _coefficients(section))


def _pinhole(section: Section) -> Camera:
    distortion = section.choice("distortion_model", ("equidistant", "radtan"))
    fx, fy, cx, cy = section.numbers("intrinsics", 4)
    positive(section, "intrinsics", (fx, fy))
    size, coefficients = image_size(section, "resolution"), _coefficients(section)
    if distortion == "equidistant":
        return KannalaBrandt(size, (fx, fy), (cx, cy), coefficients)
    return Pinhole(size, (fx, fy), (cx, cy), (*coefficients, 0.0))


def _coefficients(section: Section) -> tuple[float, float, float, float]:
    first, second, third, fourth = section.numbers("distortion_coeffs", 4)
    return first, second, third, fourth


def _write(camera: Camera, path: Path) -> str:
    intrinsics: list[float]
    match camera:
        case KannalaBrandt():
            model, distortion, coefficients = "pinhole", "equidistant", list(camera.distortion)
            intrinsics = [*camera.focal_px, *camera.centre]
        case Equidistant():
            model, distortion, coefficients = "pinhole", "equidistant", [0.0] * 4
            intrinsics = [*camera.focal_px, *camera.centre]
        case Unified():
            model, distortion, coefficients = "omni", "radtan", list(camera.distortion)
            intrinsics = [camera.xi, *camera.focal_px, *camera.centre]
        case Pinhole() if camera.distortion[4] == 0:
            model, distortion, coefficients = "pinhole", "radtan", list(camera.distortion[:4])
            intrinsics = [*camera.focal_px, *camera.centre]
        case _:
            holds = "kannala_brandt, equidistant, unified, or pinhole with k3 of 0"
            raise cannot_hold(camera, path, "Kalibr's file", holds)
    content = {
        "camera_model": model,
        "distortion_model": distortion,
        "distortion_coeffs": [float(k) for k in coefficients],
        "intrinsics": [float(v) for v in intrinsics],
        "resolution": [int(n) for n in camera.image_size],
    }
    return yaml.safe_dump({"cam0": content}, sort_keys=False, default_flow_style=None)


FORMAT = CameraFormat("kalibr", _refusal, _read, _write)
