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
from rich.console import Console

from pipeline.api.job import Job, value_source
from pipeline.artefacts.wall_map import WallMap
from pipeline.commands.working import Assignments, ConfigFile, worked
from pipeline.errors import InputError
from pipeline.files.json_file import read_json
from pipeline.files.provenance import MadeBy
from pipeline.machine.configuration import resolve
from pipeline.machine.exporter import Exporter
from pipeline.machine.plan import Source
from pipeline.machine.stage import Of, Stage, of_role
from pipeline.recording.input_file import files_sha256
from stages.compare.reference import (
    SURFACE_SUFFIXES,
    ReferenceSurface,
    WallPoints,
    map_file,
    read_surface,
    read_wall_map,
    read_wall_points,
)
from stages.compare.verification import wall_coverage
from stages.compare.verify import VERIFY_BORE, VERIFY_MAP, VERIFY_SURFACE, KnownBore, Verification


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
        typer.Option(help="points farther from a surface are not on it, mm (default: 5)"),
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
        worked(Job("verify", sources, (stage,), exporters, configuration, folder), Console(stderr=True))
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
        # of one run: its part of the variance of the difference, as the random σ of both have it
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
    # matplotlib takes a second to load, which figures alone need not wait for
    from pipeline.commands.verify_report import write_certificate

    write_certificate(certificate_document(names, wall, found, made_by), found.differences, folder)


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
