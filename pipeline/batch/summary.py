"""The summary of a batch: batch.json, and batch.html over all runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from pipeline.batch.work import Ending
from pipeline.files.disk import disk_errors_named, replace_json, replace_text
from pipeline.machine.codec import Json
from pipeline.pages import page_template

SHOWN_METRICS = ("inspected length", "wall seen", "mean diameter", "defects", "deepest defect")


def write_summary(endings: Iterable[Ending], folder: Path) -> None:
    """Write batch.json and batch.html; the order is that of the names, whoever came first.

    Raises
    ------
    InputError
        When the disk is full or cannot be written.
    """
    ordered = sorted(endings, key=lambda e: e.name)
    runs: list[Json] = [_document(e) for e in ordered]
    rows = [(e, {name: (value, unit) for name, value, unit in e.metrics}) for e in ordered]
    warned = sum(bool(e.warnings) for e in ordered)
    text = page_template("pipeline.batch").render(
        rows=rows, states=_states(ordered), metrics=SHOWN_METRICS, warned=warned
    )
    with disk_errors_named(folder):
        replace_json(folder / "batch.json", {"format": 1, "runs": runs, "states": dict(_states(ordered))})
        replace_text(folder / "batch.html", text)


def _states(endings: list[Ending]) -> Counter[str]:
    return Counter(e.state for e in endings)


def _document(ending: Ending) -> Json:
    metrics: list[Json] = [{"name": n, "value": v, "unit": u} for n, v, u in ending.metrics]
    return {
        "name": ending.name, "state": ending.state, "problem": ending.problem, "metrics": metrics,
        "warnings": list(ending.warnings),
    }  # fmt: skip
