"""The report of a camera calibration: calibration.json, and calibration.html with its maps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.arrays import Float
from pipeline.files.json_yaml import json_number
from pipeline.files.provenance import MadeBy
from pipeline.instrument.camera.calibration import CalibrationReport, ModelScore
from pipeline.instrument.camera.mapping import camera_to_mapping
from pipeline.pages import page_template, rendered


def uncertainty_figure(report: CalibrationReport) -> Figure:
    """Return maps of the projection's 1 σ, with and without the unobservable rotation, corners dotted."""
    figure = Figure(figsize=(12.5, 5), layout="constrained")
    map_ = report.uncertainty
    titles = ("Up to a rotation of the camera", "In the camera's own frame")
    for axes, sigma, title in zip(
        figure.subplots(1, 2), (map_.sigma_px, map_.raw_sigma_px), titles, strict=True
    ):
        _heat(figure, axes, report, map_.uv, sigma, "1 σ of the projection, px")
        axes.plot(*report.calibration.uv.T, ".", color="white", ms=1.2, alpha=0.5)
        axes.set_title(title, fontsize=11)
    return figure


def residual_figure(report: CalibrationReport) -> Figure:
    """Return the residuals as enlarged vectors over the image, and against the image radius."""
    figure = Figure(figsize=(12.5, 5), layout="constrained")
    left, right = figure.subplots(1, 2)
    fitted = report.calibration
    length = np.hypot(*fitted.residual_px.T)
    arrows = left.quiver(
        *fitted.uv.T, *fitted.residual_px.T, length, angles="xy", cmap="viridis", width=0.002, pivot="tail"
    )
    _image_axes(left, report)
    left.set_title("Projected minus observed corner", fontsize=11)
    figure.colorbar(arrows, ax=left, label="length, px")
    radius = np.hypot(*(fitted.uv - fitted.camera.centre_px).T)
    outward = (fitted.uv - fitted.camera.centre_px) / np.maximum(radius, 1e-9)[:, None]
    right.plot(radius, np.sum(fitted.residual_px * outward, -1), ".", ms=3, color="#0a5ea8")
    right.axhline(0, color="#5b6875", lw=0.8)
    right.set(xlabel="distance from the centre, px", ylabel="radial residual, px")
    right.set_title("A trend here is a wrong model", fontsize=11)
    right.grid(alpha=0.3)
    return figure


def displacement_figure(report: CalibrationReport) -> Figure:
    """Return the displacement of directions in the compared camera, as colours and arrows."""
    map_ = report.displacement
    if map_ is None:
        raise ValueError("nothing was compared")
    figure = Figure(figsize=(8, 5.2), layout="constrained")
    axes = figure.subplots()
    length = np.hypot(*np.moveaxis(map_.displacement_px, -1, 0))
    _heat(figure, axes, report, map_.uv, length, "displacement, px")
    every = (slice(None, None, 3), slice(None, None, 3))
    direction = map_.displacement_px[every] / np.maximum(length[every], 1e-12)[..., None]
    seen = np.isfinite(direction).all(-1)
    axes.quiver(
        *map_.uv[every][seen].T, *direction[seen].T, angles="xy", color="white", alpha=0.7, width=0.002
    )
    return figure


def png(figure: Figure) -> bytes:
    """Return a figure as PNG, the same bytes for the same content."""
    return rendered(figure, dpi=110)


def _heat(
    figure: Figure, axes: Axes, report: CalibrationReport, uv: Float, values: Float, label: str
) -> None:
    """Draw a map with a colour range of its inner 90 %, so that extrapolated corners do not dominate."""
    seen = values[np.isfinite(values)]
    top = float(np.percentile(seen, 90)) if seen.size else 1.0
    mesh = axes.pcolormesh(
        uv[..., 0], uv[..., 1], np.ma.masked_invalid(values), cmap="viridis", vmin=0, vmax=max(top, 1e-9),
        shading="gouraud",
    )  # fmt: skip
    _image_axes(axes, report)
    figure.colorbar(mesh, ax=axes, label=label, extend="max")


def _image_axes(axes: Axes, report: CalibrationReport) -> None:
    width, height = report.calibration.camera.image_size
    axes.set(xlim=(0, width - 1), ylim=(height - 1, 0), aspect="equal", xlabel="u, px", ylabel="v, px")


def write_report(report: CalibrationReport, compared_file: str, made_by: MadeBy, folder: Path) -> None:
    """Write calibration.json and calibration.html; ``compared_file`` is empty unless one was given."""
    document = report_document(report, compared_file) | {"made_by": made_by.document()}
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "calibration.json").write_text(text + "\n", "utf-8")
    (folder / "calibration.html").write_text(report_page(report, document), "utf-8")


def report_document(report: CalibrationReport, compared_file: str) -> dict[str, Any]:
    """Return the report as plain data; unknown values are None."""
    fitted = report.calibration
    sigma = np.sqrt(np.diag(fitted.covariance))
    map_ = report.uncertainty
    return {
        "format": 1,
        "camera": camera_to_mapping(fitted.camera),
        "parameters": [
            {"name": n, "value": float(v), "sigma": float(s)}
            for n, v, s in zip(fitted.camera.parameter_names, fitted.camera.parameters, sigma, strict=True)
        ],
        "covariance": fitted.covariance.tolist(),
        "rms_px": fitted.rms_px,
        "rms_per_coordinate_px": fitted.rms_px / float(np.sqrt(2)),
        "mean_distance_px": float(np.hypot(*fitted.residual_px.T).mean()),
        "corner_sigma_px": fitted.sigma_px,
        "corners": len(fitted.uv),
        "board": _board(report),
        "views": [
            {"name": n, "rms_px": float(r)} for n, r in zip(fitted.names, fitted.view_rms_px, strict=True)
        ],
        "rejected": [{"name": n, "reason": r} for n, r in report.rejected],
        "models": [_score(s) for s in sorted(report.scores, key=_rank)],
        "projection_sigma_px": {
            "u": map_.uv[0, :, 0].tolist(),
            "v": map_.uv[:, 0, 1].tolist(),
            "without_rotation": _rounded(map_.sigma_px),
            "in_camera_frame": _rounded(map_.raw_sigma_px),
        },
        "comparison": _comparison(report, compared_file),
    }


def report_page(report: CalibrationReport, document: dict[str, Any]) -> str:
    """Return the report as one self-contained file."""
    pictures = {"uncertainty": png(uncertainty_figure(report)), "residuals": png(residual_figure(report))}
    if report.displacement is not None:
        pictures["displacement"] = png(displacement_figure(report))
    return page_template("calibrate_camera").render(d=document, pictures=pictures)


def _board(report: CalibrationReport) -> dict[str, Any]:
    """Return the board's shape, and the distances of its corners from their nominal places."""
    sag, survey = report.calibration.shape_mm, report.survey
    largest = float(np.abs(sag).max() if survey is None else np.linalg.norm(survey.offset_mm, axis=1).max())
    return {
        "shape": report.board_shape,
        "largest_offset_mm": largest,
        "sag_mm": dict(zip(("xx", "xy", "yy"), map(float, sag), strict=True)),
        "nominal_mm": [] if survey is None else survey.nominal_mm.tolist(),
        "offset_mm": [] if survey is None else survey.offset_mm.tolist(),
    }


def _score(score: ModelScore) -> dict[str, Any]:
    return {
        "model": score.model,
        "parameters": score.parameters,
        "rms_px": json_number(score.rms_px),
        "held_out_rms_px": json_number(score.held_out_rms_px),
        "refusal": score.refusal,
    }


def _rank(score: ModelScore) -> float:
    return float(np.nan_to_num(score.held_out_rms_px, nan=np.inf))


def _comparison(report: CalibrationReport, compared_file: str) -> dict[str, Any] | None:
    if report.displacement is None or report.compared_with is None:
        return None
    length = np.hypot(*np.moveaxis(report.displacement.displacement_px, -1, 0))
    seen = length[np.isfinite(length)]
    if not seen.size:
        return None
    return {
        "with": compared_file or f"the next best model, {report.compared_with.model}",
        "rotation_taken_out_deg": np.rad2deg(report.displacement.rotation_rad).tolist(),
        "median_px": float(np.median(seen)),
        "p95_px": float(np.percentile(seen, 95)),
        "largest_px": float(seen.max()),
        "length_px": _rounded(length),
    }


def _rounded(values: Float) -> list[list[float | None]]:
    return [[json_number(round(float(v), 4)) for v in row] for row in values]
