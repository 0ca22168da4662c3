"""``boresight error-model``: the effect of a tilted laser sheet on the radius, as figures and page."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from jinja2 import Environment, StrictUndefined
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D
from rich.console import Console

from pipeline.commands import OffsetDown, OffsetRight, PipeDiameter
from pipeline.files.disk import written_together
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.formats import read_camera
from pipeline.instrument.misalignment import (
    MisalignedScan,
    MisreadRing,
    allowed_tilt_deg,
    implied_baselines_mm,
    misalignment_error,
    misread_ring,
    paper_error,
)
from pipeline.instrument.probe_file import read_probe
from pipeline.pages import rendered, tidy

# Baseline of the physics notes; see `implied_baselines_mm` for the one that the paper's figures imply.
PAPER_BASELINE_MM = 22.0
# Figures that the paper states without its baseline: bore of 4 inch, mm; tilt, deg; error of the radius, mm.
_PAPER_CASE = (101.6, 0.05, 0.1)
# Table of a camera model that the page does not have: every degree up to 110°, every 7.5° around; the page
# interpolates linearly.
_THETA_STEP_RAD, _THETA_COUNT, _PSI_COUNT = math.radians(1), 111, 48
INCH_MM = 25.4
_TRUE, _READ, _DISTANCE, _MUTED = "#0a5ea8", "#b04a00", "#1d6f42", "#5b6875"
_STYLES = ((_DISTANCE, ":"), (_READ, "--"), (_TRUE, "-"))


def ring_figure(scan: MisalignedScan) -> Figure:
    """Return Fig. 4: the ring and the triangulated ring in 3D, and the error around the ring."""
    ring = misread_ring(scan)
    figure = Figure(figsize=(12, 5.2), layout="constrained")
    _draw_rings(figure.add_subplot(1, 2, 1, projection="3d"), ring)
    _draw_around(figure.add_subplot(1, 2, 2), scan, ring)
    figure.suptitle(
        f"{scan.diameter_mm:g} mm pipe ({scan.diameter_mm / INCH_MM:.3g} inch), "
        f"sheet tilted {scan.tilt_deg:g}°, baseline {scan.baseline_mm:.4g} mm"
    )
    return figure


def tilt_figure(scan: MisalignedScan, accuracy_mm: float) -> Figure:
    """Return Fig. 5: the largest error over tilt in 2, 3 and 4 inch pipes, the probe in their middle."""
    figure = Figure(figsize=(8.5, 5.5), layout="constrained")
    axes = figure.add_subplot()
    reach = np.degrees(np.arctan(scan.baseline_mm / (2 * INCH_MM)))
    largest_tilt_deg = min(1.0, 0.9 * float(reach))
    tilts = np.linspace(0, largest_tilt_deg, 41)
    for inches, (colour, line) in zip((2, 3, 4), _STYLES, strict=True):
        pipe = replace(scan, diameter_mm=inches * INCH_MM, tilt_deg=0.0, offset_x_mm=0.0, offset_y_mm=0.0)
        exact = [misalignment_error(replace(pipe, tilt_deg=t)).max_radial_mm for t in tilts]
        paper = [float(paper_error(pipe.radius_mm, pipe.baseline_mm, np.radians(t))) for t in tilts]
        axes.plot(tilts, exact, line, color=colour, label=f"{inches} inch, exact")
        axes.plot(
            tilts, paper, line, color=colour, lw=0.8, alpha=0.75, label=f"{inches} inch, paper's equation"
        )
    axes.axhline(accuracy_mm, color=_MUTED, lw=1, ls=(0, (1, 2)), label=f"{accuracy_mm:g} mm")
    _finish(axes, "tilt of the sheet φ, °", "largest radial error, mm")
    radial, euclidean = implied_baselines_mm(*_PAPER_CASE)
    axes.set_title(
        f"Largest error over tilt at baseline {scan.baseline_mm:.4g} mm\n"
        f"(the paper's 0.1 mm at 0.05° in 4 inch implies {radial:.1f} mm, Euclidean {euclidean:.1f} mm)",
        fontsize=11,
    )
    axes.set(xlim=(0, largest_tilt_deg), ylim=(0, None))
    return figure


def save_figure(figure: Figure, folder: Path, name: str) -> None:
    """Write ``name``.png and ``name``.svg; the same figure gives the same bytes."""
    for kind in ("png", "svg"):
        (folder / f"{name}.{kind}").write_bytes(rendered(figure, kind, dpi=150, salt=name))


def _draw_rings(axes: Axes3D, ring: MisreadRing) -> None:
    for points, line, colour, label in (
        (ring.xyz_c, "-", _TRUE, "on the wall"),
        (ring.xyz_assumed_c, "--", _READ, "triangulated with the plane z = l"),
    ):
        x, y, z = np.concatenate([points, points[:1]]).T
        axes.plot(x, z, -y, line, color=colour, label=label)
    axes.set(xlabel="x, mm", ylabel="z, mm", zlabel="−y, mm")
    axes.set_box_aspect((1, 0.6, 1), zoom=0.92)
    axes.view_init(elev=16, azim=-62)
    axes.yaxis.set_major_locator(MaxNLocator(3))
    axes.legend(loc="upper left", fontsize=9)


def _draw_around(axes: Axes, scan: MisalignedScan, ring: MisreadRing) -> None:
    azimuth = np.degrees(ring.azimuth_rad) - scan.tilt_direction_deg
    paper = paper_error(scan.radius_mm, scan.baseline_mm, np.radians(scan.tilt_deg), np.radians(azimuth))
    axes.plot(azimuth, -ring.radial_mm, color=_TRUE, label="radial error, exact (true − triangulated)")
    axes.plot(azimuth, paper, "--", color=_READ, label="paper's equation at every azimuth")
    axes.plot(azimuth, ring.euclidean_mm, ":", color=_DISTANCE, label="distance of the points, eq. (3)")
    for at in (int(np.argmax(-ring.radial_mm)), int(np.argmin(-ring.radial_mm))):
        axes.annotate(
            f"{abs(ring.radial_mm[at]):.3f} mm", (azimuth[at], -ring.radial_mm[at]),
            xytext=(8, 8 if ring.radial_mm[at] < 0 else -14), textcoords="offset points",
        )  # fmt: skip
    axes.axhline(0, color=_MUTED, lw=0.8)
    axes.set(xlim=(0, 360), xticks=range(0, 361, 45))
    _finish(axes, "azimuth from the side toward which the sheet leans, °", "error, mm")
    axes.legend(fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def _finish(axes: Axes, x_label: str, y_label: str) -> None:
    axes.set(xlabel=x_label, ylabel=y_label)
    tidy(axes)


def error_model(
    probe: Annotated[
        Path | None,
        typer.Argument(help="probe.yaml: its camera is put into the page, its baseline is the default"),
    ] = None,
    camera_file: Annotated[
        Path | None, typer.Option("--camera", help="camera file of any known format, in place of the probe's")
    ] = None,
    diameter_mm: PipeDiameter = 101.6,
    tilt_deg: Annotated[float, typer.Option(help="tilt of the laser sheet, deg")] = 0.6,
    baseline_mm: Annotated[
        float | None, typer.Option(help="camera to laser sheet, mm (default: the probe's, else 22)")
    ] = None,
    accuracy_mm: Annotated[
        float | None, typer.Option(help="required accuracy, mm: gives the tilt it allows (page: 0.1)")
    ] = None,
    tilt_direction_deg: Annotated[
        float, typer.Option(help="azimuth in C toward which the sheet leans forward, deg")
    ] = 0.0,
    opening_angle_deg: Annotated[float, typer.Option(help="opening angle of the sheet, deg")] = 180.0,
    offset_x_mm: OffsetRight = 0.0,
    offset_y_mm: OffsetDown = 0.0,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder for figures and page (default: error-model)")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="print the numbers as JSON; files only with -o")
    ] = False,
) -> None:
    """Show how a tilted laser sheet falsifies the radius: the paper's equation and the exact model."""
    stated = None if probe is None else read_probe(probe)
    default_baseline = PAPER_BASELINE_MM if stated is None else stated.laser.baseline_mm
    scan = MisalignedScan(
        diameter_mm, default_baseline if baseline_mm is None else baseline_mm, tilt_deg,
        tilt_direction_deg, opening_angle_deg, offset_x_mm, offset_y_mm,
    )  # fmt: skip
    seen_with = camera_file if camera_file is not None else probe
    camera = read_camera(camera_file) if camera_file is not None else stated.camera if stated else None
    numbers = error_numbers(scan, camera, accuracy_mm)
    if output is not None or not as_json:
        folder = Path("error-model") if output is None else output
        name = "" if seen_with is None else seen_with.name
        write_error_model(scan, camera, name, 0.1 if accuracy_mm is None else accuracy_mm, folder)
    if as_json:
        typer.echo(json.dumps(numbers, indent=2))
    else:
        _show(scan, numbers, folder)


def error_numbers(
    scan: MisalignedScan, camera: Camera | None, accuracy_mm: float | None
) -> dict[str, float | None]:
    """Return the numbers of ``--json``, with the allowed tilt where an accuracy is required."""
    numbers: dict[str, float | None] = dict(asdict(misalignment_error(scan, camera)))
    if accuracy_mm is not None:
        allowed = allowed_tilt_deg(scan, accuracy_mm)
        numbers["allowed_tilt_deg"] = None if math.isnan(allowed) else allowed
    return numbers


def write_error_model(
    scan: MisalignedScan, camera: Camera | None, camera_name: str, accuracy_mm: float, folder: Path
) -> None:
    """Write fig4 and fig5 (PNG, SVG) and the interactive ``error-model.html``."""
    with written_together(folder, last="error-model.html") as new:
        save_figure(ring_figure(scan), new, "fig4-ring")
        save_figure(tilt_figure(scan, accuracy_mm), new, "fig5-tilt")
        page = error_model_page(scan, camera, camera_name, accuracy_mm)
        (new / "error-model.html").write_text(page, "utf-8")


def error_model_page(
    scan: MisalignedScan, camera: Camera | None, camera_name: str, accuracy_mm: float
) -> str:
    """Return the interactive page as one self-contained file."""
    radial, euclidean = implied_baselines_mm(*_PAPER_CASE)
    start = {
        **asdict(scan),
        "accuracy_mm": accuracy_mm,
        "camera": None if camera is None else page_camera(camera),
        "camera_name": camera_name,
        "implied_baseline": {"radial_mm": radial, "euclidean_mm": euclidean},
    }
    parts = files("pipeline.pages")
    template = Environment(undefined=StrictUndefined, autoescape=False).from_string(
        (parts / "error_model.html").read_text("utf-8")
    )
    return template.render(
        style=(parts / "error_model.css").read_text("utf-8"),
        model=(parts / "error_model.js").read_text("utf-8"),
        view=(parts / "error_model_view.js").read_text("utf-8"),
        start=json.dumps(start).replace("</", "<\\/"),
    )


def page_camera(camera: Camera) -> dict[str, object]:
    """Return a camera for the page: Kannala-Brandt as its parameters, any other as a table."""
    common = {"image_size": list(camera.image_size), "centre_px": camera.centre_px.tolist()}
    if camera.model == "kannala_brandt":
        names = dict(zip(camera.parameter_names, camera.parameters.tolist(), strict=True))
        return common | {
            "model": camera.model,
            "focal_px": [names["fx"], names["fy"]],
            "distortion": [names[f"k{i}"] for i in (1, 2, 3, 4)],
        }
    return common | {
        "model": "table", "label": camera.model, "theta_step_rad": _THETA_STEP_RAD, "table": _table(camera),
    }  # fmt: skip


def _table(camera: Camera) -> list[list[list[float] | None]]:
    """Return a table of (radial, tangential) px from the centre over polar angle and azimuth."""
    theta = np.arange(_THETA_COUNT)[:, None] * _THETA_STEP_RAD
    psi = 2 * np.pi * np.arange(_PSI_COUNT)[None] / _PSI_COUNT
    c, s = np.cos(psi) + 0 * theta, np.sin(psi) + 0 * theta
    uv = camera.project(np.stack([np.sin(theta) * c, np.sin(theta) * s, np.cos(theta) + 0 * c], -1)).uv
    du, dv = np.moveaxis(uv - camera.centre_px, -1, 0)
    polar = np.round(np.stack([du * c + dv * s, dv * c - du * s], -1), 4)
    return [[None if np.isnan(cell).any() else cell.tolist() for cell in row] for row in polar]


def _show(scan: MisalignedScan, numbers: dict[str, float | None], folder: Path) -> None:
    console = Console()
    console.print(
        f"{scan.diameter_mm:g} mm pipe, sheet tilted {scan.tilt_deg:g}°, baseline {scan.baseline_mm:g} mm"
    )
    for name, value in numbers.items():
        console.print(f"  {name:<24}{'none' if value is None else f'{value:.4f}'}")
    radial, euclidean = implied_baselines_mm(*_PAPER_CASE)
    console.print(
        "The larger error is on the side the sheet leans away from. The paper's 0.1 mm at 0.05° in "
        f"a 4 inch pipe implies a baseline of {radial:.1f} mm (radial) or {euclidean:.1f} mm (Euclidean). "
        "A small tilt shifts the ring: one ring cannot distinguish it from an off-centre probe."
    )
    console.print(f"Figures and interactive page: {folder}", soft_wrap=True)
