"""The report of a proof: proof.json with every trial, and proof.html."""

from __future__ import annotations

import json
import math
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from stages.diagnose.drill.score import Rate, Trial, calibration, confusion, score

# What each rate is held to, from the demand; None where it is told only.
GOALS: tuple[tuple[str, str, str], ...] = (
    ("false_alarms", "False alarms where nothing is hidden", "0"),
    ("detected", "Detected", "≥ 99 % at oracle SNR ≥ 8"),
    ("channel_right", "Located: channel", "≥ 97 %"),
    ("fixed_to_right", "Located: what it is fixed to", "≥ 97 %"),
    ("time_right", "Located: behaviour in time", "≥ 97 %"),
    ("named_exactly", "Named exactly (single effects)", "≥ 95 % where identifiable"),
    ("contained", "Name or class contains the truth", "≥ 99 %"),
    ("misnamed", "Confident wrong name", "≤ 0.5 %"),
    ("pairs_named", "Pairs: both named", "≥ 90 %"),
    ("unknown_owned", "Left out of the library: unexplained or a class of its likes", "≥ 90 %"),
    ("unknown_misnamed", "Left out of the library: misnamed", "≤ 5 %"),
    ("size_in_95", "Sizes within their 95 % interval", "93–97 %"),
)


def write_report(trials: list[Trial], folder: Path) -> None:
    """Write proof.json and proof.html."""
    document = report_document(trials)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "proof.json").write_text(text + "\n", "utf-8")
    page = files("pipeline.commands.prove_page").joinpath("page.html").read_text("utf-8")
    environment = Environment(undefined=StrictUndefined, autoescape=True)
    (folder / "proof.html").write_text(environment.from_string(page).render(d=document), "utf-8")


def report_document(trials: list[Trial]) -> dict[str, Any]:
    """Return the report as plain data; a share of no trials is None."""
    scores = score(trials)
    rates = vars(scores)
    return {
        "format": 1,
        "rates": [_rate(name, words, goal, rates[name]) for name, words, goal in GOALS],
        "size_bias_sigma": _known(scores.size_bias_sigma),
        "heldout_removed_median": _known(scores.heldout_removed),
        "confusion": [
            {"concealed": truth, "said": said, "count": count}
            for (truth, said), count in sorted(confusion(trials).items())
        ],
        "calibration": [
            {"probability": mean, "right": r.share, "of": r.of, "interval": r.interval}
            for mean, r in calibration(trials)
        ],
        "trials": [_trial(t) for t in trials],
    }


def _rate(name: str, words: str, goal: str, rate: Rate) -> dict[str, Any]:
    share = _known(rate.share)
    interval = list(rate.interval)
    return {"name": name, "words": words, "goal": goal, "share": share, "of": rate.of, "interval": interval}


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


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
    }
