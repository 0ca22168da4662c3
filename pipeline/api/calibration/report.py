"""The report of a gauge calibration: calibration.json, and calibration.html with its maps."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.api.calibration.figures import (
    correlation_figure,
    image_figure,
    png,
    radius_figure,
    run_figure,
)
from pipeline.arrays import Float
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe import Probe
from pipeline.pages import page_template
from stages.calibrate.gauge.result import GaugeCalibration, WeakDirection

_UNDETERMINED = 0.7
_SHOWN = 6


def write_report(result: GaugeCalibration, made_by: MadeBy, folder: Path) -> None:
    """Write calibration.json and calibration.html."""
    document = report_document(result) | {"made_by": made_by.document()}
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "calibration.json").write_text(text + "\n", "utf-8")
    (folder / "calibration.html").write_text(report_page(result, document), "utf-8")


def report_document(result: GaugeCalibration) -> dict[str, Any]:
    """Return the report as plain data; what is not known is None."""
    free = np.flatnonzero(np.diag(result.probe.covariance) > 0)
    sigma = np.sqrt(np.diag(result.probe.covariance))[free]
    covariance = result.probe.covariance[np.ix_(free, free)]
    names = [result.probe.parameter_names[k] for k in free]
    return {
        "format": 1,
        "gauge": result.name,
        "parameters": [_parameter(result, int(k)) for k in free],
        "laser": _laser(result.probe),
        "correlations": {"names": names, "matrix": (covariance / np.outer(sigma, sigma)).round(4).tolist()},
        "covariance": covariance.tolist(),
        "sheet": result.sheet.value,
        "evidence": {model.value: drop for model, drop in result.evidence.items()},
        "encoder": _encoder(result),
        "bores": [
            {"stated_radius_mm": r.radius_mm, "correction_mm": float(c), "sigma_mm": float(s)}
            for r, c, s in zip(result.radii, result.bore_mm, result.bore_sigma_mm, strict=True)
        ],
        "radius_error": [
            {
                "radius_mm": r.radius_mm,
                "before_mean_mm": float(r.before_mm.mean()),
                "before_largest_mm": float(np.abs(r.before_mm).max()),
                "stated_sigma_mm": float(r.stated_sigma_mm.max()),
                "sigma_mm": float(r.sigma_mm.max()),
            }
            for r in result.radii
        ],
        "residuals": {
            "edge_rms_px": _robust(result.edge_residual_px),
            "edges": len(result.edge_residual_px),
            "edge_spread_sigma": result.edge_spread,
            "ring_rms_mm": _robust(result.ring_residual_mm),
            "ring_bins": len(result.ring_residual_mm),
            "ring_spread_sigma": result.ring_spread,
        },
        "outvoted": {"fiducials": result.wrong_fiducials.tolist(), "rings": result.wrong_rings.tolist()},
        "left_out": result.left_out,
        "weak_directions": [_weak(w) for w in result.weak[:_SHOWN]],
    }


def report_page(result: GaugeCalibration, document: dict[str, Any]) -> str:
    """Return the report as one file that needs nothing else."""
    figures = {
        "image": image_figure(result),
        "run": run_figure(result),
        "radius": radius_figure(result),
        "correlations": correlation_figure(document["correlations"]),
    }
    encoded = {name: base64.b64encode(png(figure)).decode("ascii") for name, figure in figures.items()}
    return page_template("calibrate").render(d=document, pictures=encoded)


def advice(names: tuple[str, ...]) -> str:
    """Return which motion would determine a combination of these parameters better."""
    sideways = {"cx", "cy", "tilt_x", "tilt_y", "decentre_x_mm", "decentre_y_mm"}
    if set(names) & sideways:
        return "drive the probe farther off-centre, to all sides, and roll it"
    if any(name.startswith("wave") for name in names):
        return "roll the probe by a full turn"
    if "baseline_mm" in names and len(names) == 1:
        return "a gauge of closer bore tolerance"
    return "more bores of different diameter, with fiducials in view up to the edge of the image"


def _parameter(result: GaugeCalibration, k: int) -> dict[str, Any]:
    change = float(result.probe.parameters[k] - result.stated.parameters[k])
    stated = float(np.sqrt(result.stated.covariance[k, k]))
    return {
        "name": result.probe.parameter_names[k],
        "value": float(result.probe.parameters[k]),
        "sigma": float(np.sqrt(result.probe.covariance[k, k])),
        "stated": float(result.stated.parameters[k]),
        "stated_sigma": stated,
        "change": change,
        "change_in_stated_sigma": change / stated if stated > 0 else None,
    }


def _laser(probe: Probe) -> dict[str, float]:
    laser = probe.laser
    return {
        "tilt_deg": float(np.degrees(np.arctan(np.hypot(laser.tilt_x, laser.tilt_y)))),
        "tilt_direction_deg": float(np.degrees(np.arctan2(laser.tilt_y, laser.tilt_x))),
        "opening_angle_deg": 180 - 2 * float(np.degrees(laser.cone_rad)),
        "baseline_mm": laser.baseline_mm,
    }


def _encoder(result: GaugeCalibration) -> dict[str, Any] | None:
    if not np.isfinite(result.encoder).all():
        return None
    names = ("scale", "offset_mm", "delay_s")
    return {
        n: {"value": float(v), "sigma": float(s)}
        for n, v, s in zip(names, result.encoder, result.encoder_sigma, strict=True)
    }


def _weak(weak: WeakDirection) -> dict[str, Any]:
    return {
        "change": weak.change,
        "radius_mm": weak.radius_mm,
        "prior_share": weak.prior_share,
        "determined": weak.prior_share < _UNDETERMINED,
        "better": advice(tuple(weak.change)),
    }


def _robust(values: Float) -> float:
    return robust_spread(values) if len(values) else 0.0
