"""``boresight verify``: a run against a known bore, a reference surface, another run or a truth map."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from pipeline.artefacts.wall_map import WallMap
from pipeline.errors import InputError
from pipeline.files.disk import written_together
from pipeline.files.provenance import MadeBy
from pipeline.recording.input_file import files_sha256
from stages.compare.reference import (
    SURFACE_SUFFIXES,
    map_file,
    read_surface,
    read_wall_map,
    read_wall_points,
)
from stages.compare.registration.by_points import register_points
from stages.compare.registration.by_radius import align_maps
from stages.compare.verification import (
    Accuracy,
    Differences,
    accuracy,
    bore_differences,
    map_differences,
    surface_differences,
    wall_coverage,
)


@dataclass(frozen=True)
class Verification:
    """What was compared, how both were brought together, the differences and their figures."""

    kind: str
    reference: str
    alignment: dict[str, Any]
    differences: Differences
    figures: Accuracy


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
    reference_unit: Annotated[str, typer.Option(help="unit of a mesh or cloud: mm or m")] = "mm",
    max_shift_mm: Annotated[
        float, typer.Option(min=0, max=1000, help="how far apart the origins of distance may be, mm")
    ] = 8.0,
    max_roll_deg: Annotated[
        float, typer.Option(min=0, max=180, help="how far apart the origins of roll may be, deg")
    ] = 5.0,
    reach_mm: Annotated[
        float, typer.Option(min=0.01, help="points farther from a mesh or cloud do not lie on it, mm")
    ] = 5.0,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder of the certificate (default: RUN/verify)")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print the figures; files only with -o")] = False,
) -> None:
    """Say how accurate a run is: bias, RMS, 95 %, interval coverage or repeatability, as a certificate."""
    wall = read_wall_map(run)
    if (reference is None) == (bore_diameter_mm is None):
        raise InputError("verify", "give either --reference or --bore-diameter-mm")
    if bore_diameter_mm is not None:
        found = _against_bore(wall, bore_diameter_mm, bore_tolerance_mm)
    elif reference is not None and reference.suffix.lower() in SURFACE_SUFFIXES:
        found = _against_surface(run, reference, reference_unit, reach_mm)
    elif reference is not None:
        found = _against_map(wall, reference, max_shift_mm, max_roll_deg)
    document = certificate_document(run.resolve().name, wall, found)
    document["made_by"] = _made_by(run, reference).document()
    if output is not None or not as_json:
        # matplotlib takes a second to load
        from pipeline.commands.verify_report import write_certificate

        folder = run / "verify" if output is None else output
        with written_together(folder, last="certificate.json") as new:
            write_certificate(document, found.differences, new)
    if as_json:
        typer.echo(json.dumps(document, ensure_ascii=False))
    else:
        _show(document, folder)


def _made_by(run: Path, reference: Path | None) -> MadeBy:
    files = {"wall": run} | ({} if reference is None else {"reference": reference})
    return MadeBy("verify", {name: files_sha256((map_file(file),)) for name, file in files.items()})


def certificate_document(run: str, wall: WallMap, found: Verification) -> dict[str, Any]:
    """Return the certificate as plain data; shares that are not known are None."""
    figures = {
        k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(found.figures).items()
    }
    document = {
        "format": 1,
        "run": run,
        "kind": found.kind,
        "reference": found.reference,
        "coverage": wall_coverage(wall),
        "length_mm": float(np.ptp(found.differences.distance_mm)),
        "accuracy": figures,
        "alignment": found.alignment,
    }
    if found.kind == "repeatability":
        # of one run: its part of the variance of the difference, as the random σ of both have it
        own = np.mean(wall.sigma_random_mm[np.isfinite(wall.radius_mm)] ** 2)
        part = float(own / np.mean(found.differences.sigma_random_mm**2))
        deviation = float(np.std(found.differences.error_mm)) * math.sqrt(part)
        document["repeatability_sd_mm"] = deviation
        document["repeatability_limit_mm"] = 1.96 * math.sqrt(2) * deviation
    return document


def _against_bore(wall: WallMap, diameter_mm: float, tolerance_mm: float) -> Verification:
    if not (math.isfinite(diameter_mm) and diameter_mm > 0):
        raise InputError("verify", f"{diameter_mm} is out of range", place="--bore-diameter-mm",
                         expected="a diameter above 0 mm")  # fmt: skip
    differences = bore_differences(wall, diameter_mm, tolerance_mm)
    name = f"bore of {diameter_mm:g} mm ± {tolerance_mm:g} mm"
    return Verification("known bore", name, {}, differences, accuracy(differences))


def _against_map(wall: WallMap, path: Path, max_shift_mm: float, max_roll_deg: float) -> Verification:
    other = read_wall_map(path)
    if other.radius_mm.shape == wall.radius_mm.shape and np.array_equal(
        other.radius_mm, wall.radius_mm, equal_nan=True
    ):
        raise InputError(path, "is the same map as the run's", expected="an independent reference or run")
    alignment = align_maps(wall, other, max_shift_mm, max_roll_deg)
    differences = map_differences(wall, other, alignment)
    kind = "repeatability" if (other.sigma_mm > 0).any() else "reference map"
    return Verification(kind, path.name, asdict(alignment), differences, accuracy(differences))


def _against_surface(run: Path, path: Path, unit: str, reach_mm: float) -> Verification:
    units = {"mm": 1.0, "m": 1000.0}
    if unit not in units:
        raise InputError(
            "verify", f"unit {unit!r} is not known", place="--reference-unit", expected="mm or m"
        )
    if not path.is_file():
        raise InputError(path, "does not exist", expected="a mesh or a cloud")
    surface, points = read_surface(path, units[unit]), read_wall_points(run)
    pose = register_points(points, surface)
    differences = surface_differences(points, surface, pose, reach_mm)
    alignment = {"T_rp": pose.T_rp.tolist(), "rms_mm": pose.rms_mm}
    kind = "reference mesh" if len(surface.triangles) else "reference cloud"
    return Verification(kind, path.name, alignment, differences, accuracy(differences))


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
