"""The report of a gauge calibration: calibration.json, and calibration.html with its maps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.ndimage import median

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int
from pipeline.files.json_yaml import json_number
from pipeline.files.provenance import MadeBy
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.pages import page_template, rendered
from stages.calibrate.gauge.result import GaugeCalibration, RadiusError, WeakDirection

# From this share of its prior σ on, a combination of parameters counts as undetermined (chosen); combinations
# listed; side of the cells, px, whose median residual a map shows.
_UNDETERMINED = 0.7
_SHOWN = 6
_CELL_PX = 40


def write_report(result: GaugeCalibration, made_by: MadeBy, folder: Path) -> None:
    """Write calibration.json and calibration.html."""
    document = report_document(result) | {"made_by": made_by.document()}
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "calibration.json").write_text(text + "\n", "utf-8")
    (folder / "calibration.html").write_text(report_page(result, document), "utf-8")


def report_document(result: GaugeCalibration) -> dict[str, Any]:
    """Return the report as plain data; unknown values are None."""
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
        "radius_error": [_radius_error(error) for error in result.radii],
        "residuals": _residuals(result),
        "outvoted": {"fiducials": result.wrong_fiducials.tolist(), "rings": result.wrong_rings.tolist()},
        "left_out": result.left_out,
        "weak_directions": [_weak(w) for w in result.weak[:_SHOWN]],
    }


def report_page(result: GaugeCalibration, document: dict[str, Any]) -> str:
    """Return the report as one self-contained file."""
    figures = {
        "image": image_figure(result),
        "run": run_figure(result),
        "radius": radius_figure(result),
        "correlations": correlation_figure(document["correlations"]),
    }
    pictures = {name: png(figure) for name, figure in figures.items()}
    return page_template("calibrate").render(d=document, pictures=pictures)


def advice(names: tuple[str, ...]) -> str:
    """Return which motion would determine a combination of these parameters better."""
    sideways = {"cx", "cy", "tilt_x", "tilt_y", "decentre_x_mm", "decentre_y_mm"}
    if set(names) & sideways:
        return "move the probe farther off-centre, to all sides, and roll it"
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


def _radius_error(error: RadiusError) -> dict[str, float]:
    return {
        "radius_mm": error.radius_mm,
        "before_mean_mm": float(error.before_mm.mean()),
        "before_largest_mm": float(np.abs(error.before_mm).max()),
        "stated_sigma_mm": float(error.stated_sigma_mm.max()),
        "sigma_mm": float(error.sigma_mm.max()),
    }


def _residuals(result: GaugeCalibration) -> dict[str, float]:
    return {
        "edge_rms_px": _robust(result.edge_residual_px),
        "edges": len(result.edge_residual_px),
        "edge_spread_sigma": result.edge_spread,
        "ring_rms_mm": _robust(result.ring_residual_mm),
        "ring_bins": len(result.ring_residual_mm),
        "ring_spread_sigma": result.ring_spread,
    }


def _laser(probe: Probe) -> dict[str, dict[str, float | str | None]]:
    """Return the sheet in an engineer's terms; a tilt smaller than its σ has no σ of its direction."""
    values, step = _sheet_terms(probe.laser), 1e-7
    moved = [probe.laser.with_parameters(probe.laser.parameters + d) for d in step * np.eye(len(_SHEET))]
    jacobian = (np.array([_sheet_terms(sheet) for sheet in moved]) - values).T / step
    jacobian[1] = (jacobian[1] + 180 / step) % (360 / step) - 180 / step
    first = len(probe.camera.parameter_names)
    covariance = probe.covariance[first : first + len(_SHEET), first : first + len(_SHEET)]
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian))
    sigma[1] = sigma[1] if values[0] > sigma[0] else np.nan
    return {
        name: {"value": float(v), "sigma": json_number(s), "unit": unit}
        for (name, unit), v, s in zip(_TERMS, values, sigma, strict=True)
    }


_SHEET = LaserSheet.PARAMETER_NAMES
_TERMS = (("tilt_deg", "°"), ("tilt_direction_deg", "°"), ("opening_angle_deg", "°"), ("baseline_mm", "mm"))


def _sheet_terms(laser: LaserSheet) -> Float:
    """Return the four numbers of `_TERMS`."""
    tilt, direction = np.hypot(laser.tilt_x, laser.tilt_y), np.arctan2(laser.tilt_y, laser.tilt_x)
    degrees = np.degrees([np.arctan(tilt), direction, np.pi - 2 * laser.cone_rad])
    return np.array([*degrees, laser.baseline_mm])


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


def image_figure(result: GaugeCalibration) -> Figure:
    """Return maps over the image of the fiducials' and the rings' residuals."""
    figure = Figure(figsize=(12.5, 4.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    edges, rings = result.measured.edges, result.measured.rings
    _map(figure, left, result, edges.uv, result.edge_residual_px, "px")
    left.set_title("Edges of fiducials, across the edge", fontsize=11)
    _map(figure, right, result, rings.uv, 1000 * result.ring_residual_mm, "µm")
    right.set_title("Rings, radius minus bore", fontsize=11)
    return figure


def run_figure(result: GaugeCalibration) -> Figure:
    """Return residuals and position along the run."""
    figure = Figure(figsize=(12.5, 6.5), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    edges, rings = result.measured.edges, result.measured.rings
    _spread(top, result.frame, edges.frame, result.edge_residual_px)
    top.set_ylabel("edges, px")
    _spread(middle, result.frame, rings.frame, 1000 * result.ring_residual_mm)
    middle.set_ylabel("rings, µm")
    for wrong in result.wrong_rings:
        middle.axvline(wrong, color="#b3261e", lw=1)
    for part, name, style in ((0, "x", "-"), (1, "y", "--")):
        bottom.plot(result.frame, result.T_pc[:, part, 3], style, color="#0a5ea8", lw=1.3, label=name)
    bottom.set(xlabel="frame", ylabel="off the axis, mm")
    bottom.legend(ncols=2, frameon=False)
    for axes in (top, middle, bottom):
        axes.grid(alpha=0.3)
    return figure


def radius_figure(result: GaugeCalibration) -> Figure:
    """Return, for each bore, the stated probe's error and the calibrated probe's 95 % interval."""
    figure = Figure(figsize=(12.5, 3.6), layout="constrained")
    for axes, bore in zip(figure.subplots(1, len(result.radii), squeeze=False)[0], result.radii, strict=True):
        azimuth = np.degrees(bore.azimuth_rad)
        axes.plot(azimuth, bore.before_mm, color="#b3261e", lw=1.6, label="before: stated probe")
        band = 1.96 * bore.sigma_mm
        axes.fill_between(
            azimuth, -band, band, color="#0a5ea8", alpha=0.6, lw=0, label="after: 95 % interval"
        )
        axes.set(xlabel="azimuth in C, deg", ylabel="error of radius, mm")
        axes.set_title(f"bore of {2 * bore.radius_mm:g} mm", fontsize=11)
        axes.grid(alpha=0.3)
        axes.legend(frameon=False, fontsize=8)
    return figure


def correlation_figure(correlations: dict[str, Any]) -> Figure:
    """Return the correlations of the parameters."""
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    axes = figure.add_subplot()
    names = correlations["names"]
    image = axes.imshow(np.array(correlations["matrix"]), cmap="RdBu_r", vmin=-1, vmax=1)
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right")
    axes.set_yticks(range(len(names)), names)
    figure.colorbar(image, ax=axes, label="correlation")
    return figure


def png(figure: Figure) -> bytes:
    """Return the figure as a PNG, the same for the same data."""
    return rendered(figure, dpi=figure.dpi)


def _map(figure: Figure, axes: Axes, result: GaugeCalibration, uv: Float, value: Float, unit: str) -> None:
    columns, rows = (-(-side // _CELL_PX) for side in result.probe.camera.image_size)
    middle = _medians(uv, value, columns, rows)
    limit = float(np.nanpercentile(np.abs(middle), 98)) + 1e-9 if np.isfinite(middle).any() else 1.0
    extent = (0, columns * _CELL_PX, rows * _CELL_PX, 0)
    image = axes.imshow(middle, cmap="RdBu_r", vmin=-limit, vmax=limit, extent=extent)
    figure.colorbar(image, ax=axes, label=f"median residual, {unit}")
    axes.set(xlabel="u, px", ylabel="v, px")


def _medians(uv: Float, value: Float, columns: int, rows: int) -> Float:
    """Return the median (rows, columns) of values (M,) in cells of the image; NaN where there is none.

    `scipy.stats.binned_statistic_2d` does the same, but its import takes longer than all maps.
    """
    column, row = np.floor(uv / _CELL_PX).astype(np.int64).T
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    cell, out = row[inside] * columns + column[inside], np.full(rows * columns, np.nan)
    known = np.unique(cell)
    if known.size:
        out[known] = median(value[inside], cell, known)
    return out.reshape(rows, columns)


def _spread(axes: Axes, frame: Int, index: Int, value: Float) -> None:
    """Draw median and middle 68 % of the residuals in each frame."""
    numbers = np.unique(index)
    low, middle, high = np.array([np.percentile(value[index == k], (16, 50, 84)) for k in numbers]).T
    axes.fill_between(frame[numbers], low, high, color="#0a5ea8", alpha=0.3, lw=0, label="middle 68 %")
    axes.plot(frame[numbers], middle, ".", ms=3, color="#0a5ea8", label="median")
    axes.axhline(0, color="#5b6875", lw=0.8)
    axes.legend(ncols=2, frameon=False, fontsize=8)
