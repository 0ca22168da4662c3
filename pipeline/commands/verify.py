"""``boresight verify``: a run against a known bore, a reference surface, another run or a truth map."""

from __future__ import annotations

import json
import math
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from scipy.stats import binned_statistic_2d

from pipeline.api.job import Job, run_shown, value_source
from pipeline.artefacts.wall_map import WallMap
from pipeline.commands import Assignments, ConfigFile
from pipeline.errors import InputError
from pipeline.files.disk import files_sha256
from pipeline.files.json_yaml import read_json
from pipeline.files.provenance import MadeBy
from pipeline.machine.configuration import resolve
from pipeline.machine.plan import Source
from pipeline.machine.run_folder import Exporter
from pipeline.machine.stage import Of, Stage, of_role
from pipeline.pages import page_template, rendered, tidy
from stages.compare.reference import (
    SURFACE_SUFFIXES,
    ReferenceSurface,
    WallPoints,
    map_file,
    read_surface,
    read_wall_map,
    read_wall_points,
)
from stages.compare.verify import (
    VERIFY_BORE,
    VERIFY_MAP,
    VERIFY_SURFACE,
    Differences,
    KnownBore,
    Verification,
    wall_coverage,
)


@dataclass(frozen=True)
class ComparedNames:
    """What the certificate calls the run and what it is compared with."""

    run: str
    reference: str


def verify(
    run: Annotated[Path, typer.Argument(help="run folder")],
    reference: Annotated[
        Path | None,
        typer.Option(help="another run folder, a truth folder or radius map (.npz), a mesh or a cloud"),
    ] = None,
    bore_diameter_mm: Annotated[
        float | None, typer.Option(help="known bore in place of a reference, mm")
    ] = None,
    bore_tolerance_mm: Annotated[float, typer.Option(min=0, help="± of the bore's diameter, mm")] = 0.0,
    reference_unit: Annotated[
        str | None, typer.Option(help="unit of a mesh or cloud: mm (default) or m")
    ] = None,
    max_shift_mm: Annotated[
        float | None, typer.Option(help="how far apart the origins of distance may be, mm (default: 8)")
    ] = None,
    max_roll_deg: Annotated[
        float | None, typer.Option(help="how far apart the origins of roll may be, deg (default: 5)")
    ] = None,
    reach_mm: Annotated[
        float | None,
        typer.Option(
            help="points farther than this from the reference surface are left out, mm (default: 5)"
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder of the certificate (default: RUN/verify)")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print the figures; files only with -o")] = False,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Say how accurate a run is: bias, RMS, 95 %, interval coverage or repeatability, as a certificate."""
    given = (
        ("max_shift_mm", max_shift_mm),
        ("max_roll_deg", max_roll_deg),
        ("reach_mm", reach_mm),
        ("reference_unit", reference_unit),
    )
    chosen = [f"verify.{name}={value}" for name, value in given if value is not None]
    wall = read_wall_map(run)
    configuration = resolve((VERIFY_MAP,), config, [*chosen, *(assignments or ())])
    stage, against, name = _against(wall, reference, bore_diameter_mm, bore_tolerance_mm)
    names = value_source(ComparedNames(run.resolve().name, name))
    sources: tuple[Source, ...] = (_map_source("wall", run, wall), against, names)
    if stage is VERIFY_SURFACE:
        points = Source(WallPoints, read_wall_points(run), files_sha256((run / "cloud.ply",)))
        sources = (*sources, points)
    with tempfile.TemporaryDirectory() as own:
        silent = as_json and output is None
        folder = Path(own) if silent else output or run / "verify"
        exporters = (FIGURES,) if silent else (PAGE, FIGURES)
        run_shown(Job("verify", sources, (stage,), exporters, configuration, folder), Console(stderr=True))
        document = read_json(folder / "certificate.json")
    if as_json:
        typer.echo(json.dumps(document, ensure_ascii=False))
    else:
        _show(document, folder)


def _against(
    wall: WallMap, reference: Path | None, diameter_mm: float | None, tolerance_mm: float
) -> tuple[Stage, Source, str]:
    """Return the stage that compares, what it compares the wall with, and what that is called."""
    if (reference is None) == (diameter_mm is None):
        raise InputError("verify", "give either --reference or --bore-diameter-mm")
    if reference is None:
        bore = _known_bore(diameter_mm or 0.0, tolerance_mm)
        name = f"bore of {bore.diameter_mm:g} mm ± {bore.tolerance_mm:g} mm"
        return VERIFY_BORE, value_source(bore), name
    if reference.suffix.lower() in SURFACE_SUFFIXES:
        return VERIFY_SURFACE, _surface_source(reference), reference.name
    other = read_wall_map(reference)
    if np.array_equal(other.radius_mm, wall.radius_mm, equal_nan=True):
        raise InputError(
            reference, "is the same map as the run's", expected="an independent reference or run"
        )
    return VERIFY_MAP, _map_source("reference", reference, other), reference.name


def _map_source(role: str, path: Path, wall: WallMap) -> Source:
    return Source(of_role(WallMap, role), wall, files_sha256((map_file(path),)))


def _known_bore(diameter_mm: float, tolerance_mm: float) -> KnownBore:
    if not (math.isfinite(diameter_mm) and diameter_mm > 0):
        raise InputError("verify", f"{diameter_mm} is out of range", place="--bore-diameter-mm",
                         expected="a diameter above 0 mm")  # fmt: skip
    return KnownBore(diameter_mm, tolerance_mm)


def _surface_source(path: Path) -> Source:
    if not path.is_file():
        raise InputError(path, "does not exist", expected="a mesh or a cloud")
    return Source(of_role(ReferenceSurface, "reference"), read_surface(path), files_sha256((path,)))


def certificate_document(
    names: ComparedNames, wall: WallMap, found: Verification, made_by: MadeBy
) -> dict[str, Any]:
    """Return the certificate as plain data; shares that are not known are None."""
    figures = {
        k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(found.figures).items()
    }
    alignment = {} if found.alignment is None else asdict(found.alignment)
    document = {
        "format": 1,
        "run": names.run,
        "kind": found.kind,
        "reference": names.reference,
        "coverage": wall_coverage(wall),
        "length_mm": float(np.ptp(found.differences.distance_mm)),
        "accuracy": figures,
        "alignment": {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in alignment.items()},
    }
    if found.kind == "repeatability":
        # the share of one run in the variance of the difference, by the stated random σ of both
        own = np.mean(wall.sigma_random_mm[np.isfinite(wall.radius_mm)] ** 2)
        part = float(own / np.mean(found.differences.sigma_random_mm**2))
        deviation = float(np.std(found.differences.error_mm)) * math.sqrt(part)
        document["repeatability_sd_mm"] = deviation
        document["repeatability_limit_mm"] = 1.96 * math.sqrt(2) * deviation
    return document | {"made_by": made_by.document()}


def write_figures(
    found: Verification,
    wall: Annotated[WallMap, Of("wall")],
    names: ComparedNames,
    made_by: MadeBy,
    folder: Path,
) -> None:
    """Write certificate.json."""
    document = certificate_document(names, wall, found, made_by)
    text = json.dumps(document, indent=1, ensure_ascii=False)
    (folder / "certificate.json").write_text(text + "\n", "utf-8")


def write_page(
    found: Verification,
    wall: Annotated[WallMap, Of("wall")],
    names: ComparedNames,
    made_by: MadeBy,
    folder: Path,
) -> None:
    """Write certificate.html and certificate.png."""
    drawn = rendered(differences_figure(found.differences))
    (folder / "certificate.png").write_bytes(drawn)
    document = certificate_document(names, wall, found, made_by)
    page = page_template("verify").render(d=document, picture=drawn)
    (folder / "certificate.html").write_text(page, "utf-8")


PAGE, FIGURES = Exporter("certificate", write_page), Exporter("figures", write_figures)


def _show(document: dict[str, Any], folder: Path) -> None:
    figures = document["accuracy"]
    typer.echo(f"{document['run']} against {document['reference']} ({document['kind']})")
    for name in ("bias_mm", "rms_mm", "mad_sigma_mm", "p95_mm", "max_mm"):
        typer.echo(f"  {name:<22}{figures[name]:9.4f}")
    for name in ("within_95", "within_95_random"):
        if figures[name] is not None:
            typer.echo(f"  {name:<22}{figures[name]:9.1%}")
    if "repeatability_sd_mm" in document:
        typer.echo(f"  {'repeatability_sd_mm':<22}{document['repeatability_sd_mm']:9.4f}")
    typer.echo(f"Certificate: {folder / 'certificate.html'}")


# Cells of the pictured map along the pipe and around it: about as many as the picture has room for.
_STATIONS, _SECTORS = 300, 120


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
        axes.plot(x, stated, color="#b04a00", ls="--", label="expected from the stated σ")
    axes.set(xlabel="run − reference, µm", yticks=[])
    axes.set_title("Distribution", fontsize=11)
    tidy(axes)
