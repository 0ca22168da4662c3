"""The ``camera:`` section of probe.yaml: a mapping with ``model`` and that model's own parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.equidistant import Equidistant
from pipeline.instrument.camera.fields import Fields, nearest
from pipeline.instrument.camera.kannala_brandt import KannalaBrandt
from pipeline.instrument.camera.pinhole import Pinhole
from pipeline.instrument.camera.scaramuzza import Scaramuzza, scaramuzza_problem
from pipeline.instrument.camera.unified import Unified

SCARAMUZZA_TERMS = 15


def camera_from_mapping(mapping: Mapping[str, object], file: Path) -> Camera:
    """Return the camera that the ``camera:`` section of ``file`` describes.

    Raises
    ------
    InputError
        Naming the key at fault: missing, unknown, of another type or length, not finite, or not positive
        where it must be; or an unknown model, with the nearest known one.
    """
    fields = Fields(mapping, file, "camera")
    name = fields.text("model")
    if name not in MODELS:
        raise fields.error(
            "model", f"unknown camera model {name!r}{nearest(name, MODELS)}", ", ".join(MODELS)
        )
    camera = MODELS[name](fields)
    fields.refuse_others()
    return camera


def camera_to_mapping(camera: Camera) -> dict[str, object]:
    """Return the ``camera:`` section that `camera_from_mapping` reads back to the same camera."""
    shared: dict[str, object] = {"model": camera.model, "image_size": list(camera.image_size)}
    match camera:
        case KannalaBrandt():
            return shared | _lists(
                focal_px=camera.focal_px, centre_px=camera.centre, distortion=camera.distortion
            )
        case Equidistant():
            return shared | _lists(focal_px=camera.focal_px, centre_px=camera.centre)
        case Scaramuzza():
            return shared | _lists(
                centre_px=camera.centre, polynomial=camera.polynomial, affine=camera.affine
            )
        case Unified():
            lists = _lists(focal_px=camera.focal_px, centre_px=camera.centre, distortion=camera.distortion)
            return shared | {"xi": float(camera.xi)} | lists
        case Pinhole():
            return shared | _lists(
                focal_px=camera.focal_px, centre_px=camera.centre, distortion=camera.distortion
            )
        case _:
            raise TypeError(f"no mapping is known for {type(camera).__name__}")


def _lists(**values: tuple[float, ...]) -> dict[str, object]:
    return {key: [float(v) for v in value] for key, value in values.items()}


def _focal_and_centre(fields: Fields) -> tuple[tuple[int, int], tuple[float, float], tuple[float, float]]:
    return fields.image_size(), fields.pair("focal_px", positive=True), fields.pair("centre_px")


def _kannala_brandt(fields: Fields) -> Camera:
    k1, k2, k3, k4 = fields.numbers("distortion", 4)
    return KannalaBrandt(*_focal_and_centre(fields), (k1, k2, k3, k4))


def _equidistant(fields: Fields) -> Camera:
    return Equidistant(*_focal_and_centre(fields))


def _pinhole(fields: Fields) -> Camera:
    k1, k2, p1, p2, k3 = fields.numbers("distortion", 5)
    return Pinhole(*_focal_and_centre(fields), (k1, k2, p1, p2, k3))


def _unified(fields: Fields) -> Camera:
    size, focal, centre = _focal_and_centre(fields)
    k1, k2, p1, p2 = fields.numbers("distortion", 4)
    xi = fields.number("xi")
    if xi < 0:
        raise fields.error("xi", f"is {xi}", "a number from 0 (pinhole) up")
    return Unified(size, xi, focal, centre, (k1, k2, p1, p2))


def _scaramuzza(fields: Fields) -> Camera:
    c, d, e = fields.numbers("affine", 3)
    polynomial = fields.numbers("polynomial", 3, SCARAMUZZA_TERMS)
    problem = scaramuzza_problem(polynomial, (c, d, e))
    if problem:
        raise fields.error(*problem)
    return Scaramuzza(fields.image_size(), fields.pair("centre_px"), tuple(polynomial), (c, d, e))


MODELS: Mapping[str, Callable[[Fields], Camera]] = {
    "kannala_brandt": _kannala_brandt,
    "equidistant": _equidistant,
    "scaramuzza": _scaramuzza,
    "unified": _unified,
    "pinhole": _pinhole,
}
