"""Figures of a gauge calibration: residuals over image and run, radius before and after, correlations."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binned_statistic_2d

from pipeline.arrays import Float, Int
from pipeline.pages.figure import rendered
from stages.calibrate.gauge.result import GaugeCalibration

_CELL_PX = 40


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
    width, height = result.probe.camera.image_size
    bins = [np.arange(0, width + _CELL_PX, _CELL_PX), np.arange(0, height + _CELL_PX, _CELL_PX)]
    mean = binned_statistic_2d(uv[:, 0], uv[:, 1], value, "median", bins).statistic
    limit = float(np.nanpercentile(np.abs(mean), 98)) + 1e-9 if np.isfinite(mean).any() else 1.0
    image = axes.imshow(
        mean.T, cmap="RdBu_r", vmin=-limit, vmax=limit, extent=(0, bins[0][-1], bins[1][-1], 0)
    )
    figure.colorbar(image, ax=axes, label=f"median residual, {unit}")
    axes.set(xlabel="u, px", ylabel="v, px")


def _spread(axes: Axes, frame: Int, index: Int, value: Float) -> None:
    """Draw median and middle 68 % of the residuals in each frame."""
    numbers = np.unique(index)
    low, middle, high = np.array([np.percentile(value[index == k], (16, 50, 84)) for k in numbers]).T
    axes.fill_between(frame[numbers], low, high, color="#0a5ea8", alpha=0.3, lw=0, label="middle 68 %")
    axes.plot(frame[numbers], middle, ".", ms=3, color="#0a5ea8", label="median")
    axes.axhline(0, color="#5b6875", lw=0.8)
    axes.legend(ncols=2, frameon=False, fontsize=8)
