"""``boresight error-budget``: every source of error, its share in the radius, and the dominant ones."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter
from rich.console import Console
from rich.table import Table

from pipeline.adjustment.robust import root_mean_square
from pipeline.arrays import Float
from pipeline.commands import OffsetDown, OffsetRight, PipeDiameter
from pipeline.errors import InputError
from pipeline.files.disk import written_together
from pipeline.instrument.budget import Budget, Row
from pipeline.instrument.budget import error_budget as analytic_budget
from pipeline.instrument.budget.design import (
    BaselineStudy,
    Tolerance,
    baseline_study,
    dominant_rows,
    tolerances,
)
from pipeline.instrument.budget.monte_carlo import MonteCarlo, monte_carlo
from pipeline.instrument.budget.scan import Pose, RingScan
from pipeline.instrument.budget.sources import NOT_IN_RADIUS, Kind, typical_probe
from pipeline.instrument.probe_file import read_probe
from pipeline.pages import page_template, rendered

# Default of the required accuracies: the seed paper's 0.1 mm, and that of a calibrated probe.
ACCURACIES_MM = (0.1, 0.02)
_COLOURS = ("#0a5ea8", "#b04a00", "#1d6f42", "#7a3e9d", "#8a6d00")
_LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))


def budget_document(
    budget: Budget,
    drawn: MonteCarlo | None,
    draws: int,
    study: BaselineStudy,
    tolerances: Mapping[float, Sequence[Tolerance]],
    probe_name: str,
) -> dict[str, Any]:
    """Return everything as plain data; lengths in mm, rows by decreasing share."""
    rows = [
        _row(row, share, None if drawn is None else drawn.rows[row.source.name])
        for row, share in dominant_rows(budget)
    ]
    return {
        "format": 1,
        "probe": probe_name,
        "diameter_mm": budget.scan.diameter_mm,
        "baseline_mm": budget.scan.probe.laser.baseline_mm,
        "offset_mm": list(budget.scan.offset_mm),
        "azimuth_deg": np.degrees(budget.scan.azimuth_rad).tolist(),
        "monte_carlo_draws": 0 if drawn is None else draws,
        "rows": rows,
        "total": _totals(budget, drawn),
        "dominant": rows[0]["name"],
        "tolerances": [
            {"accuracy_mm": accuracy, "sources": [asdict(t) for t in allowed]}
            for accuracy, allowed in tolerances.items()
        ],
        "best_baseline": _best_baseline(study),
        "not_included": NOT_IN_RADIUS,
    }


def _row(row: Row, share: float, drawn: Mapping[Pose, Float] | None) -> dict[str, Any]:
    """Return one source of error, with its figures for the axis as known and as fitted."""
    figures = {p.value: _figures(row.sigma_mm[p], None if drawn is None else drawn[p]) for p in Pose}
    source = row.source
    return {
        "name": source.name, "label": source.label, "kind": source.kind.value, "table_one": source.table_one,
        "sigma": row.sigma, "unit": source.unit, "origin": row.origin, "share": share, **figures,
    }  # fmt: skip


def _best_baseline(study: BaselineStudy) -> dict[str, Any]:
    return {
        "diameter_mm": study.diameter_mm.tolist(),
        "each_mm": study.best_mm.tolist(),
        "overall_mm": study.best_overall_mm,
        "good_from_mm": study.good_from_mm,
        "baseline_mm": study.baseline_mm.tolist(),
        "sigma_mm": [[None if math.isnan(s) else s for s in row] for row in study.sigma_mm.tolist()],
    }


def write_budget(document: dict[str, Any], budget: Budget, study: BaselineStudy, folder: Path) -> None:
    """Write budget.json, budget.png, budget.svg and budget.html."""
    (folder / "budget.json").write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", "utf-8")
    figure = budget_figure(budget, study)
    pictures = {kind: rendered(figure, kind, dpi=150, salt="budget") for kind in ("png", "svg")}
    for kind, content in pictures.items():
        (folder / f"budget.{kind}").write_bytes(content)
    (folder / "budget.html").write_text(budget_page(document, pictures["svg"]), "utf-8")


def budget_page(document: dict[str, Any], chart_svg: bytes) -> str:
    """Return the page as one self-contained file."""
    return page_template("error_budget").render(d=document, chart=chart_svg)


def budget_figure(budget: Budget, study: BaselineStudy) -> Figure:
    """Return the largest rows and the sum over azimuth, and the sum over the baseline."""
    figure = Figure(figsize=(12.5, 5.2), layout="constrained")
    _draw_azimuth(figure.add_subplot(1, 2, 1), budget)
    _draw_baselines(figure.add_subplot(1, 2, 2), study, budget.scan.probe.laser.baseline_mm)
    return figure


def _totals(budget: Budget, drawn: MonteCarlo | None) -> dict[str, Any]:
    kinds: dict[str, Kind | None] = {"systematic": Kind.SYSTEMATIC, "random": Kind.RANDOM, "all": None}
    return {
        name: {
            pose.value: _figures(
                budget.total_mm(kind, pose), drawn.total[pose] if drawn is not None and kind is None else None
            )
            for pose in Pose
        }
        for name, kind in kinds.items()
    } | {"uncorrelated": {pose.value: _figures(budget.uncorrelated_mm(pose), None) for pose in Pose}}


def _figures(sigma_mm: Float, drawn_mm: Float | None) -> dict[str, Any]:
    figures: dict[str, Any] = {
        "rms_mm": root_mean_square(sigma_mm),
        "max_mm": float(sigma_mm.max()), "sigma_mm": np.round(sigma_mm, 7).tolist(),
    }  # fmt: skip
    return figures if drawn_mm is None else figures | {"monte_carlo_rms_mm": root_mean_square(drawn_mm)}


def _draw_azimuth(axes: Axes, budget: Budget) -> None:
    azimuth = np.degrees(budget.scan.azimuth_rad)
    axes.plot(
        azimuth, 1000 * budget.total_mm(None, Pose.KNOWN), color="#16202b", lw=2.5, label="all together"
    )
    largest = [row for row, _ in dominant_rows(budget)[:5]]
    for row, colour, line in zip(largest, _COLOURS, _LINES, strict=False):
        axes.plot(azimuth, 1000 * row.sigma_mm[Pose.KNOWN], ls=line, color=colour, label=row.source.label)
    axes.set(xlim=(-180, 180), xticks=range(-180, 181, 90))
    axes.set(ylim=(0, 1350 * float(budget.total_mm(None, Pose.KNOWN).max())))
    axes.set(xlabel="azimuth in C, °", ylabel="1 σ of the radius, µm")
    axes.set_title(
        f"{budget.scan.diameter_mm:.4g} mm pipe, baseline {budget.scan.probe.laser.baseline_mm:.4g} mm"
    )
    _finish(axes)


def _draw_baselines(axes: Axes, study: BaselineStudy, baseline_mm: float) -> None:
    for diameter, sigma, best, colour, line in zip(
        study.diameter_mm, study.sigma_mm.T, study.best_mm, _COLOURS, _LINES, strict=False
    ):
        label = f"{diameter / 25.4:.3g} inch, best {best:.0f} mm"
        axes.plot(study.baseline_mm, 1000 * sigma, ls=line, color=colour, label=label)
    axes.axvline(
        baseline_mm, color="#5b6875", lw=1, ls=(0, (1, 2)), label=f"this probe, {baseline_mm:.4g} mm"
    )
    axes.set(xlabel="baseline, mm", ylabel="1 σ of the radius, µm", title="Over the baseline")
    axes.set(yscale="log")
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(ScalarFormatter())
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.grid(alpha=0.3, which="both")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=9, loc="upper right", ncols=2)


def error_budget(
    probe: Annotated[
        Path | None,
        typer.Argument(help="probe.yaml, stated or calibrated (default: a typical uncalibrated probe)"),
    ] = None,
    diameter_mm: PipeDiameter = 101.6,
    offset_x_mm: OffsetRight = 0.0,
    offset_y_mm: OffsetDown = 0.0,
    sigma: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="1 σ of a source in its unit; may be repeated"),
    ] = None,
    accuracy_mm: Annotated[
        list[float] | None,
        typer.Option(help="required accuracy for the tolerances, mm (default: 0.1 and 0.02)"),
    ] = None,
    draws: Annotated[
        int, typer.Option(min=0, max=65536, help="Monte Carlo draws through the exact chain; 0 for none")
    ] = 256,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="folder for table, chart and page (default: error-budget)"),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="print the budget as JSON; files only with -o")
    ] = False,
) -> None:
    """List every source of error, its share in the radius, systematic and random, and their sum."""
    instrument = typical_probe() if probe is None else read_probe(probe)
    name = "typical uncalibrated probe" if probe is None else probe.name
    given = _given(sigma or [])
    scan = RingScan(instrument, diameter_mm, (offset_x_mm, offset_y_mm))
    budget = analytic_budget(scan, given)
    allowed = {a: tolerances(budget, a) for a in accuracy_mm or ACCURACIES_MM}
    study = baseline_study(scan, given)
    drawn = monte_carlo(budget, _enough(draws)) if draws else None
    document = budget_document(budget, drawn, _enough(draws), study, allowed, name)
    folder = output if output is not None else None if as_json else Path("error-budget")
    if folder is not None:
        with written_together(folder, last="budget.json") as new:
            write_budget(document, budget, study, new)
    if as_json:
        typer.echo(json.dumps(document, ensure_ascii=False))
    else:
        _show(document, Console())
        typer.echo(f"Table, chart and page: {folder}")


def _enough(draws: int) -> int:
    """Return the next power of 2 that also exceeds the number of parameters and samples."""
    return int(max(128, 1 << (draws - 1).bit_length()))


def _given(assignments: list[str]) -> dict[str, float]:
    given = {}
    for text in assignments:
        name, _, value = text.partition("=")
        try:
            given[name] = float(value)
        except ValueError:
            raise InputError("--sigma", f"{text!r} is not an assignment", expected="NAME=NUMBER") from None
    return given


def _show(document: dict[str, Any], console: Console) -> None:
    pipe = f"{document['diameter_mm']:g} mm pipe, baseline {document['baseline_mm']:g} mm"
    table = Table(title=f"1 σ of the radius: {pipe}")
    table.add_column("source", no_wrap=True)
    for heading in ("1 σ", "from"):
        table.add_column(heading)
    for heading in ("µm", "axis fitted", "drawn", "share"):
        table.add_column(heading, justify="right")
    for row in document["rows"]:
        if row["known"]["max_mm"] > 0:
            table.add_row(
                row["name"], f"{row['sigma']:.3g} {row['unit']}", row["origin"],
                *_columns(row), f"{row['share']:.1%}",
            )  # fmt: skip
    for name, total in document["total"].items():
        table.add_row(f"sum, {name}", "", "", *_columns(total), "", style="bold")
    console.print(table)
    best = document["best_baseline"]
    each = ", ".join(f"{b:g}" for b in best["each_mm"])
    console.print(f"Best baseline for 2, 3, 4 inch: {each} mm; for all three {best['overall_mm']:g} mm "
                  f"(within 10 % from {best['good_from_mm']:g} mm on).")  # fmt: skip
    for wished in document["tolerances"]:
        first = ", ".join(f"{t['name']} {t['alone']:.3g} {t['unit']}" for t in wished["sources"][:6])
        console.print(f"Each of these alone would cost {wished['accuracy_mm']:g} mm: {first}.")


def _columns(figures: dict[str, Any]) -> tuple[str, str, str]:
    known, fitted = figures["known"], figures["fitted"]
    drawn = known.get("monte_carlo_rms_mm")
    return (
        f"{1000 * known['rms_mm']:.1f}",
        f"{1000 * fitted['rms_mm']:.1f}",
        "" if drawn is None else f"{1000 * drawn:.1f}",
    )
