"""The report of a proof: proof.json with every trial, and proof.html."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from pipeline.commands.prove_cases import Worked
from pipeline.files.provenance import MadeBy
from pipeline.pages import page_template
from stages.diagnose.drill.figures import Figure, figures
from stages.diagnose.drill.score import Trial, calibration, confusion


def write_report(done: Sequence[Worked], folder: Path) -> None:
    """Write proof.json and proof.html."""
    document = report_document(done)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "proof.json").write_text(text + "\n", "utf-8")
    (folder / "proof.html").write_text(page_template("prove").render(d=document), "utf-8")


def report_document(done: Sequence[Worked]) -> dict[str, Any]:
    """Return the report as plain data; a figure of no trials has the value None."""
    trials = [trial for case in done for trial in case.trials]
    seconds = [case.seconds for case in done if case.seconds is not None]
    return {
        "format": 2,
        "made_by": MadeBy("prove", {}).document(),
        "figures": [vars(row) | {"text": row.text} for row in rows_of(done)],
        "seconds": {"median": median(seconds), "most": max(seconds), "of": len(seconds)} if seconds else None,
        "unanswered": [failure for case in done if case.trials for failure in case.failures],
        "not_rendered": [failure for case in done if not case.trials for failure in case.failures],
        "confusion": [
            {"concealed": truth, "said": said, "count": count}
            for (truth, said), count in sorted(confusion(trials).items())
        ],
        "calibration": [
            {"probability": mean, "right": r.share, "of": r.of, "interval": r.interval}
            for mean, r in calibration(trials)
        ],
        "trials": [_trial(t) for t in trials],
        "wall_errors_mm": {c.trials[0].name: vars(c.wall) for c in done if c.wall is not None},
    }


def rows_of(done: Sequence[Worked]) -> tuple[Figure, ...]:
    """Return the rows of the table, the wall's error among them."""
    ratios = [
        case.wall.corrected_mm / case.wall.oracle_mm
        for case in done
        if case.wall is not None and case.trials[0].concealed
    ]
    words = "Wall error after correction, of the oracle's, median"
    value = median(ratios) if ratios else None
    wall = Figure("wall_error", words, "≤ 1.1", value, len(ratios), None)
    return (*figures([trial for case in done for trial in case.trials]), wall)


def _trial(trial: Trial) -> dict[str, Any]:
    return {
        "name": trial.name,
        "concealed": [c.model_dump() for c in trial.concealed],
        "left_out": list(trial.left_out),
        "verdict": trial.answer.verdict,
        "said": [e.model_dump() for e in trial.answer.effects],
        "class": list(trial.answer.members),
        "global_p": trial.answer.global_p,
        "exact": trial.exact,
        "misnamed": trial.misnamed,
        "snr": trial.snr,
        "identifiable": trial.identifiable,
    }
