"""The certificate of a verification: JSON, picture and one page."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binned_statistic_2d

from pipeline.pages import page_template
from pipeline.pages.figure import rendered, tidy
from stages.compare.verification import Differences

_STATIONS, _SECTORS = 300, 120


def write_certificate(document: dict[str, Any], differences: Differences, folder: Path) -> None:
    """Write certificate.png and certificate.html."""
    drawn = rendered(differences_figure(differences))
    (folder / "certificate.png").write_bytes(drawn)
    (folder / "certificate.html").write_text(certificate_page(document, drawn), "utf-8")


def certificate_page(document: dict[str, Any], picture_png: bytes) -> str:
    """Return the certificate as one file that needs nothing else."""
    picture = base64.b64encode(picture_png).decode("ascii")
    return page_template("verify").render(d=document, picture=picture)


def differences_figure(differences: Differences) -> Figure:
    """Return the differences over the wall, along it, and their distribution."""
    figure = Figure(figsize=(12.5, 6.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(2.2, 1))
    _draw_wall(figure, figure.add_subplot(grid[0, 0]), differences)
    _draw_along(figure.add_subplot(grid[1, 0]), differences)
    _draw_distribution(figure.add_subplot(grid[:, 1]), differences)
    return figure


def _draw_wall(figure: Figure, axes: Axes, d: Differences) -> None:
    stations = np.linspace(d.distance_mm.min(), d.distance_mm.max() + 1e-9, _STATIONS + 1)
    sectors = np.linspace(-180, 180, _SECTORS + 1)
    azimuth = (np.degrees(d.azimuth_rad) + 180) % 360 - 180
    mean = binned_statistic_2d(
        d.distance_mm, azimuth, d.error_mm * 1000, "mean", [stations, sectors]
    ).statistic
    limit = float(np.percentile(np.abs(d.error_mm), 99)) * 1000 + 1e-9
    extent = (stations[0], stations[-1], -180, 180)
    image = axes.imshow(
        mean.T, cmap="RdBu_r", vmin=-limit, vmax=limit, extent=extent, origin="lower", aspect="auto",
        interpolation="nearest",
    )  # fmt: skip
    axes.set(xlabel="distance, mm", ylabel="azimuth, °", yticks=range(-180, 181, 90))
    axes.set_title("Run minus reference over the wall", fontsize=11)
    figure.colorbar(image, ax=axes, label="µm")


def _draw_along(axes: Axes, d: Differences) -> None:
    edges = np.linspace(d.distance_mm.min(), d.distance_mm.max() + 1e-9, 101)
    index = np.clip(np.digitize(d.distance_mm, edges) - 1, 0, 99)
    middle = (edges[:-1] + edges[1:]) / 2
    count = np.maximum(np.bincount(index, minlength=100), 1)
    mean = np.bincount(index, 1000 * d.error_mm, 100) / count
    rms = np.sqrt(np.bincount(index, 1e6 * d.error_mm**2, 100) / count)
    seen = np.bincount(index, minlength=100) > 0
    axes.plot(middle[seen], rms[seen], color="#b04a00", ls="--", label="RMS")
    axes.plot(middle[seen], mean[seen], color="#0a5ea8", label="mean")
    axes.axhline(0, color="#5b6875", lw=0.8)
    axes.set(xlabel="distance, mm", ylabel="run − reference, µm", xlim=(edges[0], edges[-1]))
    tidy(axes)


def _draw_distribution(axes: Axes, d: Differences) -> None:
    limit = float(np.percentile(np.abs(d.error_mm), 99.5)) * 1000 + 1e-9
    axes.hist(1000 * d.error_mm, bins=80, range=(-limit, limit), density=True, color="#0a5ea8", alpha=0.75)
    if np.all(d.sigma_mm > 0):
        x = np.linspace(-limit, limit, 200)
        s = 1000 * d.sigma_mm[:: max(1, len(d.sigma_mm) // 2000)]
        stated = np.mean(np.exp(-(x[:, None] ** 2) / (2 * s**2)) / (s * np.sqrt(2 * np.pi)), -1)
        axes.plot(x, stated, color="#b04a00", ls="--", label="as the stated σ has it")
    axes.set(xlabel="run − reference, µm", yticks=[])
    axes.set_title("Distribution", fontsize=11)
    tidy(axes)
