"""Kalibr's camchain YAML with one camera in a file, and camodocal's YAML, which is only read.

Kalibr: pinhole-equi, pinhole-radtan and omni-radtan. Camodocal (also inside VINS configurations):
KANNALA_BRANDT, MEI and PINHOLE.
"""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from pipeline.errors import InputError
from pipeline.files.json_yaml import Section
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.fisheye import Equidistant, KannalaBrandt
from pipeline.instrument.camera.formats.document import CameraDocument, CameraFormat, cannot_hold
from pipeline.instrument.camera.mapping import image_size, positive, side
from pipeline.instrument.camera.plumb_bob import Pinhole, Unified


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


KALIBR_FORMAT = CameraFormat("kalibr", _refusal, _read, _write)


_CAMODOCAL_MODELS = ("KANNALA_BRANDT", "MEI", "PINHOLE")


def _refusal_camodocal(document: CameraDocument) -> str:
    return document.lacks("model_type", "projection_parameters")


def _read_camodocal(document: CameraDocument) -> Camera:
    section = document.section
    model = section.choice("model_type", _CAMODOCAL_MODELS)
    size = side(section, "image_width"), side(section, "image_height")
    projection = section.section("projection_parameters")
    match model:
        case "KANNALA_BRANDT":
            k1, k2, k3, k4 = (projection.number(key) for key in ("k2", "k3", "k4", "k5"))
            return KannalaBrandt(
                size, _focal(projection, "mu", "mv"), _centre(projection, "u0", "v0"), (k1, k2, k3, k4)
            )
        case "MEI":
            xi = section.section("mirror_parameters").number("xi", least=0.0)
            focal, centre = _focal(projection, "gamma1", "gamma2"), _centre(projection, "u0", "v0")
            return Unified(size, xi, focal, centre, _distortion(section))
        case _:
            focal, centre = _focal(projection, "fx", "fy"), _centre(projection, "cx", "cy")
            return Pinhole(size, focal, centre, (*_distortion(section), 0.0))


def _focal(projection: Section, *keys: str) -> tuple[float, float]:
    first, second = (projection.number(key, above=0.0) for key in keys)
    return first, second


def _centre(projection: Section, *keys: str) -> tuple[float, float]:
    first, second = (projection.number(key) for key in keys)
    return first, second


def _distortion(section: Section) -> tuple[float, float, float, float]:
    values = section.section("distortion_parameters")
    k1, k2, p1, p2 = (values.number(key) for key in ("k1", "k2", "p1", "p2"))
    return k1, k2, p1, p2


CAMODOCAL_FORMAT = CameraFormat("camodocal", _refusal_camodocal, _read_camodocal)
