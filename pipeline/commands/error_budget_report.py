"""The error budget as plain data, chart and page."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from pipeline.arrays import Float
from pipeline.commands.figure import rendered
from pipeline.instrument.budget.combine import Budget
from pipeline.instrument.budget.design import BaselineStudy, Tolerance, dominant_rows
from pipeline.instrument.budget.monte_carlo import MonteCarlo
from pipeline.instrument.budget.scan import Pose
from pipeline.instrument.budget.sources import NOT_IN_RADIUS, Kind
from pipeline.pages import page_template

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
    """Return everything as plain data; lengths mm, rows by falling share."""
    rows = [
        {
            "name": row.source.name,
            "label": row.source.label,
            "kind": row.source.kind.value,
            "table_one": row.source.table_one,
            "sigma": row.sigma,
            "unit": row.source.unit,
            "origin": row.origin,
            "share": share,
            **{
                pose.value: _figures(
                    row.sigma_mm[pose], None if drawn is None else drawn.rows[row.source.name][pose]
                )
                for pose in Pose
            },
        }
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
        "best_baseline": {
            "diameter_mm": study.diameter_mm.tolist(),
            "each_mm": study.best_mm.tolist(),
            "overall_mm": study.best_overall_mm,
            "good_from_mm": study.good_from_mm,
            "baseline_mm": study.baseline_mm.tolist(),
            "sigma_mm": [[None if math.isnan(s) else s for s in row] for row in study.sigma_mm.tolist()],
        },
        "not_included": NOT_IN_RADIUS,
    }  # fmt: skip


def write_budget(document: dict[str, Any], budget: Budget, study: BaselineStudy, folder: Path) -> None:
    """Write budget.json, budget.png, budget.svg and budget.html."""
    (folder / "budget.json").write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", "utf-8")
    figure = budget_figure(budget, study)
    pictures = {kind: rendered(figure, kind, dpi=150, salt="budget") for kind in ("png", "svg")}
    for kind, content in pictures.items():
        (folder / f"budget.{kind}").write_bytes(content)
    (folder / "budget.html").write_text(budget_page(document, pictures["svg"]), "utf-8")


def budget_page(document: dict[str, Any], chart_svg: bytes) -> str:
    """Return the page as one file that needs nothing else."""
    chart = base64.b64encode(chart_svg).decode("ascii")
    return page_template("error_budget").render(d=document, chart=chart)


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
        "rms_mm": _rms(sigma_mm), "max_mm": float(sigma_mm.max()), "sigma_mm": np.round(sigma_mm, 7).tolist(),
    }  # fmt: skip
    return figures if drawn_mm is None else figures | {"monte_carlo_rms_mm": _rms(drawn_mm)}


def _rms(values: Float) -> float:
    return float(np.sqrt(np.mean(values**2)))


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
