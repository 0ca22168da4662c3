"""OCamCalib's ``calib_results.txt``: five lines of numbers between comments.

Direct polynomial, inverse polynomial (lowest power first, each after its count), centre as row and column,
affine c d e, image height and width. The inverse polynomial maps OCamCalib's elevation atan(z/r) to the image
radius; it approximates the inverse of the direct one, which alone is used here.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.polynomial import polynomial

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.formats.document import CameraDocument, CameraFormat, cannot_hold
from pipeline.instrument.camera.mapping import LARGEST_SIDE_PX
from pipeline.instrument.camera.scaramuzza import Scaramuzza, scaramuzza_problem

_LINES = ("direct polynomial", "inverse polynomial", "centre (row column)", "affine (c d e)", "image size")
# More coefficients than any calibration has: a file beyond that is not one.
_MOST_TERMS = 60
# A published inverse polynomial is an approximation. Where it differs by more, the two lines are taken for
# those of two cameras. Chosen, not measured.
_LARGEST_DISAGREEMENT_PX = 5.0
# Samples, degrees tried, and error aimed at of a written inverse polynomial: below what any program
# resolves.
_FIT_SAMPLES = 2000
_FIT_DEGREES = range(4, 21)
_FIT_GOAL_PX = 1e-3


def inverse_disagreement_px(camera: Scaramuzza, inverse: tuple[float, ...]) -> float:
    """Return the largest difference, px, of a published inverse from the exact one inside the image."""
    elevation, rho = _elevation_and_radius(camera)
    return float(np.abs(polynomial.polyval(elevation, np.array(inverse)) - rho).max())


def read_polynomials(document: CameraDocument) -> tuple[Scaramuzza, tuple[float, ...]]:
    """Return the camera of the direct polynomial and the coefficients of the published inverse."""
    lines = _number_lines(document)
    direct, inverse = _counted(document, lines, 0), _counted(document, lines, 1)
    (row, column), (c, d, e) = _exactly(document, lines, 2, 2), _exactly(document, lines, 3, 3)
    height, width = (_side(document, value) for value in _exactly(document, lines, 4, 2))
    problem = scaramuzza_problem(direct, (c, d, e))
    if problem:
        key, found, expected = problem
        raise InputError(document.file, found, place=key, expected=expected)
    return Scaramuzza((width, height), (column, row), direct, (c, d, e)), inverse


def _data_lines(document: CameraDocument) -> list[tuple[int, str]]:
    lines = enumerate(document.text.splitlines(), start=1)
    return [(n, line) for n, line in lines if line.strip() and not line.lstrip().startswith("#")]


def _refusal(document: CameraDocument) -> str:
    lines = _data_lines(document)
    for number, line in lines:
        if not all(_is_number(word) for word in line.split()):
            return f"line {number} is not a line of numbers"
    return "" if len(lines) == len(_LINES) else f"has {len(lines)} lines of numbers, not {len(_LINES)}"


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _number_lines(document: CameraDocument) -> list[tuple[int, list[float]]]:
    lines = [(n, [float(word) for word in line.split()]) for n, line in _data_lines(document)]
    for (number, values), what in zip(lines, _LINES, strict=True):
        if not all(math.isfinite(v) for v in values):
            raise InputError(document.file, f"{what} is not finite", place=f"line {number}")
    return lines


def _counted(document: CameraDocument, lines: list[tuple[int, list[float]]], index: int) -> tuple[float, ...]:
    number, (count, *values) = lines[index]
    if count != len(values) or not 3 <= count <= _MOST_TERMS:
        raise InputError(
            document.file,
            f"{_LINES[index]} announces {count:g} coefficients and holds {len(values)}",
            place=f"line {number}",
            expected=f"a count from 3 to {_MOST_TERMS} and as many coefficients",
        )
    return tuple(values)


def _exactly(
    document: CameraDocument, lines: list[tuple[int, list[float]]], index: int, count: int
) -> list[float]:
    number, values = lines[index]
    if len(values) != count:
        problem = f"{_LINES[index]} holds {len(values)} numbers"
        raise InputError(document.file, problem, place=f"line {number}", expected=f"{count} numbers")
    return values


def _side(document: CameraDocument, value: float) -> int:
    if value != int(value) or not 1 <= value <= LARGEST_SIDE_PX:
        expected = f"height and width in whole pixels from 1 to {LARGEST_SIDE_PX}"
        raise InputError(document.file, f"image size holds {value:g}", expected=expected)
    return int(value)


def _read(document: CameraDocument) -> Camera:
    camera, inverse = read_polynomials(document)
    apart = inverse_disagreement_px(camera, inverse)
    if not apart <= _LARGEST_DISAGREEMENT_PX:
        raise InputError(
            document.file,
            f"the direct and the inverse polynomial differ by up to {apart:.3g} px inside the image",
            expected=f"the same camera both ways, within {_LARGEST_DISAGREEMENT_PX:g} px",
            hint="export the calibration again; one of the two lines belongs to another camera",
        )
    return camera


def _elevation_and_radius(camera: Scaramuzza) -> tuple[Float, Float]:
    """Return OCamCalib's elevation and the radius along a ray through the circle inside the image."""
    (width, height), (u, v) = camera.image_size, camera.centre
    inside = max(min(u, width - u, v, height - v), 0.1 * min(width, height))
    rho = np.linspace(0, min(inside, camera.rho_max), _FIT_SAMPLES)
    return np.asarray(np.arctan2(-camera.depth(rho), rho)), rho


def _fitted_inverse(camera: Scaramuzza) -> Float:
    """Return the inverse polynomial of the lowest degree that keeps within `_FIT_GOAL_PX`."""
    elevation, rho = _elevation_and_radius(camera)
    for degree in _FIT_DEGREES:
        series = np.polynomial.Polynomial.fit(elevation, rho, degree)
        if np.abs(series(elevation) - rho).max() < _FIT_GOAL_PX:
            break
    return np.asarray(series.convert().coef)


def _write(camera: Camera, path: Path) -> str:
    if not isinstance(camera, Scaramuzza):
        raise cannot_hold(camera, path, "OCamCalib's file", "scaramuzza")
    inverse = _fitted_inverse(camera)
    (width, height), (column, row) = camera.image_size, camera.centre
    return "\n".join(
        [
            "#polynomial coefficients for the DIRECT mapping function, used by cam2world\n",
            f"{len(camera.polynomial)} {_joined(camera.polynomial)}\n",
            "#polynomial coefficients for the inverse mapping function, used by world2cam\n",
            f"{len(inverse)} {_joined(inverse)}\n",
            '#center: "row" and "column", starting from 0 (C convention)\n',
            f"{_joined((row, column))}\n",
            '#affine parameters "c", "d", "e"\n',
            f"{_joined(camera.affine)}\n",
            '#image size: "height" and "width"\n',
            f"{height} {width}\n",
        ]
    )


def _joined(values: tuple[float, ...] | Float) -> str:
    return " ".join(f"{float(v):.17g}" for v in values)


FORMAT = CameraFormat("ocamcalib", _refusal, _read, _write)
