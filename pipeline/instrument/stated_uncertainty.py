"""The section ``standard_uncertainty`` of probe.yaml and the covariance it stands for.

``focal_px`` is common to fx and fy; ``centre_px``, ``tilt_deg`` and ``decentre_mm`` hold for each axis on its
own; ``distortion`` lists the camera's other parameters in their order; ``opening_angle_deg`` is twice the
cone's; ``waviness_rad`` holds for each of its coefficients. What is not stated is 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.arrays import Float
from pipeline.files.yaml_file import Section
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe

UNCERTAINTY_KEYS = (
    "focal_px", "centre_px", "distortion", "baseline_mm", "tilt_deg", "opening_angle_deg", "decentre_mm",
    "waviness_rad", "encoder_scale",
)  # fmt: skip
_FOCAL, _CENTRE = ("fx", "fy"), ("cx", "cy")
_DEGREE = math.radians(1)
# Key of one number: the parameters it holds for, each on its own, and its factor to their unit.
_SINGLE: tuple[tuple[str, tuple[str, ...], float], ...] = (
    ("centre_px", _CENTRE, 1.0),
    ("baseline_mm", ("baseline_mm",), 1.0),
    ("tilt_deg", ("tilt_x", "tilt_y"), _DEGREE),
    ("opening_angle_deg", ("cone_rad",), _DEGREE / 2),
    ("decentre_mm", ("decentre_x_mm", "decentre_y_mm"), 1.0),
    ("waviness_rad", LaserSheet.PARAMETER_NAMES[6:], 1.0),
)


def covariance_from_stated(stated: Section, names: Sequence[str]) -> Float:
    """Return the covariance (P, P) of the parameters ``names``; see the module for its terms."""
    covariance = np.zeros((len(names), len(names)))
    for members, sigma in _terms(stated, names):
        direction = np.isin(names, members).astype(float)
        covariance += sigma**2 * np.outer(direction, direction)
    return covariance


def stated_from_covariance(probe: Probe) -> dict[str, object]:
    """Return the section to write: the root mean square of the σ of each key's parameters."""
    variance = dict(zip(probe.parameter_names, np.diag(probe.covariance).tolist(), strict=True))
    stated: dict[str, object] = {"focal_px": _rms(variance, _FOCAL)} if _FOCAL[0] in variance else {}
    stated |= {key: _rms(variance, members) / factor for key, members, factor in _SINGLE}
    distortion = _distortion_names(probe.camera.parameter_names)
    stated["distortion"] = [math.sqrt(variance[name]) for name in distortion]
    stated["encoder_scale"] = probe.encoder_scale_sigma
    return stated


def _terms(stated: Section, names: Sequence[str]) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield independent terms: the parameters that move together by one σ, and that σ."""
    if stated.has("focal_px"):
        if _FOCAL[0] not in names:
            raise stated.fail("focal_px", "has no meaning for this camera model", "σ in distortion instead")
        yield _FOCAL, stated.number("focal_px", least=0)
    for key, members, factor in _SINGLE:
        if stated.has(key):
            sigma = factor * stated.number(key, least=0)
            yield from (((member,), sigma) for member in members)
    if stated.has("distortion"):
        members = _distortion_names(names[: len(names) - len(LaserSheet.PARAMETER_NAMES)])
        sigmas = stated.numbers("distortion", len(members), least=0)
        yield from (((member,), sigma) for member, sigma in zip(members, sigmas, strict=True))


def _distortion_names(camera_names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of a camera's parameters other than focal lengths and centre."""
    return tuple(name for name in camera_names if name not in (*_FOCAL, *_CENTRE))


def _rms(variance: dict[str, float], members: Sequence[str]) -> float:
    """Return the root mean square σ of parameters."""
    return math.sqrt(sum(variance[m] for m in members) / len(members))
