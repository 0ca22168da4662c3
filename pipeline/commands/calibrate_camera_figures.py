"""Maps of a camera calibration over the image: uncertainty, residuals, displacement."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.arrays import Float
from pipeline.commands.figure import rendered
from pipeline.instrument.camera.calibration import CalibrationReport


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
    """Return by how much the camera compared with sees directions elsewhere, as colours and arrows."""
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
    """Draw a map with a colour range of its inner 90 %, so that extrapolated corners do not drown it."""
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
