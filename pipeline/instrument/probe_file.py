"""probe.yaml: stated or measured parameters of the instrument, and their covariance.

In the section ``standard_uncertainty``, ``focal_px`` is common to fx and fy; ``centre_px``, ``tilt_deg`` and
``decentre_mm`` hold for each axis independently; ``distortion`` lists the camera's other parameters in their
order; ``opening_angle_deg`` is twice the cone's; ``waviness_rad`` holds for each of its coefficients. A σ
that is not stated is 0, except ``encoder_scale``, whose default is that of `Probe`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import yaml

from pipeline.arrays import Float
from pipeline.files.codec import Json
from pipeline.files.json_yaml import Section, read_yaml
from pipeline.files.provenance import MadeBy
from pipeline.instrument.camera.mapping import camera_from_mapping, camera_to_mapping
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import ImuMount, Lighting, Probe, Shutter

UNCERTAINTY_KEYS = (
    "focal_px", "centre_px", "distortion", "baseline_mm", "tilt_deg", "opening_angle_deg", "decentre_mm",
    "waviness_rad", "encoder_scale",
)  # fmt: skip
_FOCAL, _CENTRE = ("fx", "fy"), ("cx", "cy")
_DEGREE = math.radians(1)
# For each key: the parameters whose σ it gives, each independently, and the factor to their unit.
_SINGLE: tuple[tuple[str, tuple[str, ...], float], ...] = (
    ("centre_px", _CENTRE, 1.0),
    ("baseline_mm", ("baseline_mm",), 1.0),
    ("tilt_deg", ("tilt_x", "tilt_y"), _DEGREE),
    ("opening_angle_deg", ("cone_rad",), _DEGREE / 2),
    ("decentre_mm", ("decentre_x_mm", "decentre_y_mm"), 1.0),
    ("waviness_rad", LaserSheet.PARAMETER_NAMES[6:], 1.0),
)
_KEYS = (
    "camera", "laser", "shutter", "lighting", "imu", "standard_uncertainty", "covariance", "calibrated_from",
    "made_by",
)  # fmt: skip
_LASER_KEYS = (
    "baseline_mm", "opening_angle_deg", "tilt_deg", "tilt_direction_deg", "line_sigma_mm", "wavelength_nm",
    "decentre_mm", "decentre_direction_deg", "waviness_rad",
)  # fmt: skip
_WAVES = len(LaserSheet(1.0).waviness)
# Rows of a rotation written with four digits are orthonormal to this accuracy.
_ROTATION = 1e-3


def covariance_from_stated(stated: Section, names: Sequence[str]) -> Float:
    """Return the covariance (P, P) of the parameters ``names``; the keys are those of the module's text."""
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


@dataclass(frozen=True)
class ProbeSource:
    """Where a probe comes from: its file, the gauge it was calibrated from, and what made the file."""

    path: Path
    calibrated_from: str
    made_by: Json


def read_probe(file: Path) -> Probe:
    """Read a probe file, stated or calibrated.

    Raises
    ------
    InputError
        At the key that is missing, mistyped, not finite or out of range.
    """
    return probe_from(read_yaml(file))


def probe_from(document: Section) -> Probe:
    """Return the probe that a mapping with the keys of a probe file describes; see `read_probe`."""
    document.refuse_unknown(_KEYS)
    camera = camera_from_mapping(document.section("camera").values, document.file)
    laser = _laser(document.section("laser"))
    names = (*camera.parameter_names, *LaserSheet.PARAMETER_NAMES)
    stated = _optional(document, "standard_uncertainty")
    stated.refuse_unknown(UNCERTAINTY_KEYS)
    if document.has("covariance"):
        covariance = _covariance(document.section("covariance"), names)
    else:
        covariance = covariance_from_stated(stated, names)
    return Probe(
        camera, laser, covariance,
        shutter=_shutter(_optional(document, "shutter")),
        lighting=_lighting(_optional(document, "lighting")),
        encoder_scale_sigma=_number_or(stated, "encoder_scale", Probe.encoder_scale_sigma, least=0),
        calibrated_from=document.text("calibrated_from") if document.has("calibrated_from") else "",
        imu=_imu(document.section("imu")) if document.has("imu") else None,
    )  # fmt: skip


def read_with_source(file: Path) -> tuple[Probe, ProbeSource]:
    """Read a probe file with its provenance; see `read_probe`."""
    document = read_yaml(file)
    probe = probe_from(document)
    made_by = document.section("made_by").values if document.has("made_by") else None
    # Types that YAML has and JSON lacks, such as dates, become text.
    return probe, ProbeSource(file, probe.calibrated_from, json.loads(json.dumps(made_by, default=str)))


def write_probe(probe: Probe, path: Path, made_by: MadeBy | None = None) -> None:
    """Write a probe file; `read_probe` returns the same probe, its covariance bit for bit."""
    document: dict[str, object] = {
        "camera": camera_to_mapping(probe.camera),
        "laser": _laser_mapping(probe.laser),
        "shutter": asdict(probe.shutter),
        "lighting": asdict(probe.lighting),
        "standard_uncertainty": stated_from_covariance(probe),
        "covariance": {"names": list(probe.parameter_names), "matrix": probe.covariance.tolist()},
    }
    if probe.imu is not None:
        document["imu"] = asdict(probe.imu) | {"R_ci": probe.imu.R_ci.tolist()}
    if probe.calibrated_from:
        document["calibrated_from"] = probe.calibrated_from
    if made_by is not None:
        document["made_by"] = made_by.document()
    path.write_text(yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=1000), "utf-8")


def _optional(document: Section, key: str) -> Section:
    """Return the section below a key, empty when it is absent."""
    return document.section(key) if document.has(key) else Section(document.file, {}, key)


def _number_or(
    section: Section, key: str, usual: float, *, least: float = -math.inf, above: float = -math.inf
) -> float:
    """Return the number below a key, ``usual`` when it is absent."""
    return section.number(key, least=least, above=above) if section.has(key) else usual


def _laser(section: Section) -> LaserSheet:
    section.refuse_unknown(_LASER_KEYS)
    opening = section.number("opening_angle_deg", above=90)
    if opening >= 270:
        raise section.fail("opening_angle_deg", f"is {opening}", "an angle between 90 and 270 degrees")
    tilt_x, tilt_y = _polar(section, "tilt_deg", "tilt_direction_deg")
    decentre_x, decentre_y = _polar(section, "decentre_mm", "decentre_direction_deg")
    return LaserSheet(
        baseline_mm=section.number("baseline_mm", above=0),
        tilt_x=tilt_x,
        tilt_y=tilt_y,
        cone_rad=math.radians((180 - opening) / 2),
        decentre_x_mm=decentre_x,
        decentre_y_mm=decentre_y,
        waviness=section.numbers("waviness_rad", _WAVES) if section.has("waviness_rad") else (0.0,) * _WAVES,
        line_sigma_mm=section.number("line_sigma_mm", above=0),
        wavelength_nm=section.number("wavelength_nm", above=0),
    )


def _polar(section: Section, size_key: str, direction_key: str) -> tuple[float, float]:
    """Return the x and y parts of a size and a direction; the angle of a tilt becomes a slope."""
    if not section.has(size_key) and size_key != "tilt_deg":
        return 0.0, 0.0
    size = section.number(size_key)
    if size_key == "tilt_deg":
        if abs(size) >= 45:
            raise section.fail(size_key, f"is {size}", "an angle between -45 and 45 degrees")
        size = math.tan(math.radians(size))
    direction = math.radians(section.number(direction_key)) if size else 0.0
    return size * math.cos(direction), size * math.sin(direction)


def _laser_mapping(laser: LaserSheet) -> dict[str, object]:
    return {
        "baseline_mm": laser.baseline_mm,
        "opening_angle_deg": 180 - 2 * math.degrees(laser.cone_rad),
        "tilt_deg": math.degrees(math.atan(math.hypot(laser.tilt_x, laser.tilt_y))),
        "tilt_direction_deg": math.degrees(math.atan2(laser.tilt_y, laser.tilt_x)),
        "decentre_mm": math.hypot(laser.decentre_x_mm, laser.decentre_y_mm),
        "decentre_direction_deg": math.degrees(math.atan2(laser.decentre_y_mm, laser.decentre_x_mm)),
        "waviness_rad": list(laser.waviness),
        "line_sigma_mm": laser.line_sigma_mm,
        "wavelength_nm": laser.wavelength_nm,
    }


def _shutter(section: Section) -> Shutter:
    section.refuse_unknown(("kind", "exposure_s", "readout_s"))
    usual = Shutter()
    return Shutter(
        section.choice("kind", ("global", "rolling")) if section.has("kind") else usual.kind,
        _number_or(section, "exposure_s", usual.exposure_s, above=0),
        _number_or(section, "readout_s", usual.readout_s, least=0),
    )


def _lighting(section: Section) -> Lighting:
    section.refuse_unknown(("kind", "leds", "radius_mm", "z_mm"))
    usual = Lighting()
    return Lighting(
        section.choice("kind", ("led_ring",)) if section.has("kind") else usual.kind,
        section.integer("leds", least=1) if section.has("leds") else usual.leds,
        _number_or(section, "radius_mm", usual.radius_mm, least=0),
        _number_or(section, "z_mm", usual.z_mm),
    )


def _imu(section: Section) -> ImuMount:
    """Return the mount that a section states: rows of ``R_ci``, and noise densities in Kalibr's terms."""
    names = tuple(ImuMount.__dataclass_fields__)
    section.refuse_unknown(names)
    rows = section.require("R_ci", "three rows of three numbers")
    try:
        R_ci = np.array(rows, float)
    except (TypeError, ValueError) as error:
        raise section.fail("R_ci", f"is not a table of numbers ({error})", "three rows of three") from error
    proper = R_ci.shape == (3, 3) and np.allclose(R_ci @ R_ci.T, np.eye(3), atol=_ROTATION)
    if not proper or np.linalg.det(R_ci) < 0:
        raise section.fail("R_ci", "is not a rotation", "orthonormal rows of determinant +1")
    usual = ImuMount(R_ci)
    return ImuMount(R_ci, *(_number_or(section, n, getattr(usual, n), above=0) for n in names[1:]))


def _covariance(section: Section, names: tuple[str, ...]) -> Float:
    """Return the covariance in the order of ``names``; a parameter that is not listed is taken as exact."""
    section.refuse_unknown(("names", "matrix"))
    listed = section.require("names", "a list of parameter names")
    if not isinstance(listed, list) or len(set(map(str, listed))) != len(listed):
        raise section.fail("names", "is not a list of different names", ", ".join(names))
    unknown = [str(n) for n in listed if n not in names]
    if unknown:
        raise section.fail("names", f"names {unknown[0]!r}", f"among {', '.join(names)}")
    try:
        stated = np.array(section.require("matrix", "rows of numbers"), float)
    except (TypeError, ValueError) as error:
        raise section.fail("matrix", f"is not a table of numbers ({error})") from error
    _refuse_improper(section, stated, len(listed))
    place = [names.index(n) for n in listed]
    full = np.zeros((len(names), len(names)))
    full[np.ix_(place, place)] = stated
    return full


def _refuse_improper(section: Section, matrix: Float, size: int) -> None:
    expected = f"a symmetric, positive semi-definite {size} x {size} matrix"
    if matrix.shape != (size, size):
        raise section.fail("matrix", f"has the shape {matrix.shape}", expected)
    if not np.all(np.isfinite(matrix)) or np.any(np.diag(matrix) < 0):
        raise section.fail("matrix", "holds values that are not finite, or negative variances", expected)
    sigma = np.sqrt(np.diag(matrix))
    scaled = matrix / np.where(sigma > 0, sigma, 1)[:, None] / np.where(sigma > 0, sigma, 1)
    if not np.allclose(scaled, scaled.T, atol=1e-9) or np.linalg.eigvalsh(scaled)[:1].min(initial=0) < -1e-6:
        raise section.fail("matrix", "is not a covariance", expected)
