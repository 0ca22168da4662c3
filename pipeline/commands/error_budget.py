"""``boresight error-budget``: every source of error, its share in the radius, and what dominates."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from pipeline.errors import InputError
from pipeline.files.disk import written_together
from pipeline.instrument.budget.combine import error_budget as analytic_budget
from pipeline.instrument.budget.design import baseline_study, tolerances
from pipeline.instrument.budget.monte_carlo import monte_carlo
from pipeline.instrument.budget.scan import RingScan
from pipeline.instrument.budget.sources import typical_probe
from pipeline.instrument.probe_file import read_probe

# Wished accuracies where none are given: the seed paper's 0.1 mm, and what a calibrated probe may reach.
ACCURACIES_MM = (0.1, 0.02)


def error_budget(
    probe: Annotated[
        Path | None,
        typer.Argument(help="probe.yaml, stated or calibrated (default: a typical uncalibrated probe)"),
    ] = None,
    diameter_mm: Annotated[float, typer.Option(help="inner diameter of the pipe, mm")] = 101.6,
    offset_x_mm: Annotated[float, typer.Option(help="probe off the pipe's axis, right, mm")] = 0.0,
    offset_y_mm: Annotated[float, typer.Option(help="probe off the pipe's axis, down, mm")] = 0.0,
    sigma: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="1 σ of a source in its unit; may be repeated"),
    ] = None,
    accuracy_mm: Annotated[
        list[float] | None,
        typer.Option(help="wished accuracy for the tolerances, mm (default: 0.1 and 0.02)"),
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
    # matplotlib takes a second to load
    from pipeline.commands.error_budget_report import budget_document, write_budget

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
            raise InputError("--sigma", f"{text!r} is not understood", expected="NAME=NUMBER") from None
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
        console.print(f"Alone costing {wished['accuracy_mm']:g} mm: {first}.")


def _columns(figures: dict[str, Any]) -> tuple[str, str, str]:
    known, fitted = figures["known"], figures["fitted"]
    drawn = known.get("monte_carlo_rms_mm")
    return (
        f"{1000 * known['rms_mm']:.1f}",
        f"{1000 * fitted['rms_mm']:.1f}",
        "" if drawn is None else f"{1000 * drawn:.1f}",
    )
