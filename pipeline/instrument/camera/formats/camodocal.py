"""Camodocal's YAML (also inside VINS configurations): KANNALA_BRANDT, MEI and PINHOLE. Read only."""

from __future__ import annotations

from pipeline.files.yaml_file import Section
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.formats.document import CameraDocument, CameraFormat
from pipeline.instrument.camera.kannala_brandt import KannalaBrandt
from pipeline.instrument.camera.pinhole import Pinhole
from pipeline.instrument.camera.section_values import side
from pipeline.instrument.camera.unified import Unified

_MODELS = ("KANNALA_BRANDT", "MEI", "PINHOLE")


def _refusal(document: CameraDocument) -> str:
    return document.lacks("model_type", "projection_parameters")


def _read(document: CameraDocument) -> Camera:
    section = document.section
    model = section.choice("model_type", _MODELS)
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


FORMAT = CameraFormat("camodocal", _refusal, _read)
