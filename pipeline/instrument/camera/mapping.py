"""The ``camera:`` section of probe.yaml: a mapping with ``model`` and that model's own parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.files.json_yaml import Section
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.fisheye import Equidistant, KannalaBrandt
from pipeline.instrument.camera.plumb_bob import Pinhole, Unified
from pipeline.instrument.camera.scaramuzza import Scaramuzza, scaramuzza_problem

# Largest side of a picture that image formats hold.
LARGEST_SIDE_PX = 65535


def pair(section: Section, key: str) -> tuple[float, float]:
    """Return two finite numbers."""
    first, second = section.numbers(key, 2)
    return first, second


def positive(section: Section, key: str, values: tuple[float, ...]) -> tuple[float, ...]:
    """Return ``values`` read from ``key``, all of which must be greater than 0."""
    for i, value in enumerate(values):
        if value <= 0:
            raise section.fail(f"{key}[{i}]", f"is {value:g}", "a number greater than 0")
    return values


def focal_pair(section: Section, key: str) -> tuple[float, float]:
    """Return two numbers greater than 0."""
    first, second = positive(section, key, section.numbers(key, 2))
    return first, second


def number_list(section: Section, key: str, least: int, most: int) -> tuple[float, ...]:
    """Return a list of ``least`` to ``most`` finite numbers."""
    expected = f"a list of {least} to {most} numbers"
    value = section.require(key, expected)
    if not isinstance(value, list) or not least <= len(value) <= most:
        found = f"a list of {len(value)}" if isinstance(value, list) else f"a {type(value).__name__}"
        raise section.fail(key, f"is {found}", expected)
    return section.numbers(key, len(value))


def image_size(section: Section, key: str) -> tuple[int, int]:
    """Return [width, height], whole pixels."""
    expected = f"[width, height] in whole pixels from 1 to {LARGEST_SIDE_PX}"
    value = section.require(key, expected)
    if not isinstance(value, list) or len(value) != 2:
        raise section.fail(key, f"is a {type(value).__name__}", expected)
    return _side(section, key, value[0], expected), _side(section, key, value[1], expected)


def side(section: Section, key: str) -> int:
    """Return a width or height, whole pixels."""
    expected = f"a whole number of pixels from 1 to {LARGEST_SIDE_PX}"
    return _side(section, key, section.require(key, expected), expected)


def _side(section: Section, key: str, value: object, expected: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= LARGEST_SIDE_PX:
        raise section.fail(key, f"holds {str(value)[:40]!r}", expected)
    return value


# Fewest and most coefficients: a quadratic; far more than OCamCalib's usual five.
SCARAMUZZA_TERMS = (3, 15)
_COMMON = ("model", "image_size", "centre_px")
_KEYS: Mapping[str, tuple[str, ...]] = {
    "kannala_brandt": (*_COMMON, "focal_px", "distortion"),
    "equidistant": (*_COMMON, "focal_px"),
    "scaramuzza": (*_COMMON, "polynomial", "affine"),
    "unified": (*_COMMON, "focal_px", "xi", "distortion"),
    "pinhole": (*_COMMON, "focal_px", "distortion"),
}


def camera_from_mapping(mapping: Mapping[str, object], file: Path) -> Camera:
    """Return the camera that the ``camera:`` section of ``file`` describes.

    Raises
    ------
    InputError
        Naming the key at fault: missing, unknown, of another type or length, not finite, or not positive
        where it must be; or an unknown model, with the nearest known one.
    """
    section = Section(file, mapping, "camera")
    model = section.choice("model", tuple(_KEYS))
    section.refuse_unknown(_KEYS[model])
    return _READERS[model](section)


def camera_to_mapping(camera: Camera) -> dict[str, object]:
    """Return the ``camera:`` section that `camera_from_mapping` reads back to the same camera."""
    values: dict[str, object] = {"model": camera.model, "image_size": [int(n) for n in camera.image_size]}
    attributes = {"centre_px": "centre"}
    for key in _KEYS[camera.model][2:]:
        value = getattr(camera, attributes.get(key, key))
        values[key] = [float(v) for v in value] if isinstance(value, tuple) else float(value)
    return values


def _kannala_brandt(section: Section) -> Camera:
    k1, k2, k3, k4 = section.numbers("distortion", 4)
    return KannalaBrandt(*_size_focal_centre(section), (k1, k2, k3, k4))


def _equidistant(section: Section) -> Camera:
    return Equidistant(*_size_focal_centre(section))


def _pinhole(section: Section) -> Camera:
    k1, k2, p1, p2, k3 = section.numbers("distortion", 5)
    return Pinhole(*_size_focal_centre(section), (k1, k2, p1, p2, k3))


def _unified(section: Section) -> Camera:
    size, focal, centre = _size_focal_centre(section)
    k1, k2, p1, p2 = section.numbers("distortion", 4)
    return Unified(size, section.number("xi", least=0.0), focal, centre, (k1, k2, p1, p2))


def _scaramuzza(section: Section) -> Camera:
    c, d, e = section.numbers("affine", 3)
    polynomial = number_list(section, "polynomial", *SCARAMUZZA_TERMS)
    problem = scaramuzza_problem(polynomial, (c, d, e))
    if problem:
        raise section.fail(*problem)
    return Scaramuzza(image_size(section, "image_size"), pair(section, "centre_px"), polynomial, (c, d, e))


def _size_focal_centre(section: Section) -> tuple[tuple[int, int], tuple[float, float], tuple[float, float]]:
    return image_size(section, "image_size"), focal_pair(section, "focal_px"), pair(section, "centre_px")


_READERS: Mapping[str, Callable[[Section], Camera]] = {
    "kannala_brandt": _kannala_brandt,
    "equidistant": _equidistant,
    "scaramuzza": _scaramuzza,
    "unified": _unified,
    "pinhole": _pinhole,
}
