"""The content of all reports, made once from the run and the decisions, so that all have the same text."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from typing import Any

from pipeline.artefacts.measured import Wall
from pipeline.export.report.tables import NOT_CALIBRATED
from pipeline.export.run_record import mean_diameter
from pipeline.pages import notation
from pipeline.review.decisions.ledger import Entry
from pipeline.review.decisions.replay import ACCEPTED, OPEN, REJECTED
from pipeline.review.documents import ASSUMPTIONS, cleaned, run_document
from pipeline.review.review import Review, Seal, State
from pipeline.review.tables import findings_table

_STATUS = {ACCEPTED: "accepted", REJECTED: "rejected", OPEN: "not decided"}
# Headline numbers of the run that a client needs; the others are in report.html of the run.
_METRICS = ("inspected length", "wall seen", "median 1 sigma of the radius", "motion events")


def report_content(review: Review, state: State) -> dict[str, Any]:
    """Return the content of all reports: ``findings`` as rows of numbers and words, and texts."""
    run, seal, rows = run_document(review.files), review.seal(state), findings_table(review, state)
    record = review.files.record()
    edited = {row["id"] for row in rows if row["edited"]}
    said = {str(d["id"]): d["statement"] for d in run["defects"] if str(d["id"]) not in edited}
    facts = state.described.model_dump(exclude={"do"})
    return cleaned({
        "name": run["name"],
        "program": run["program"],
        "revision": _revision(seal),
        "dated": state.entries[-1].at[:10] if state.entries else "",
        "facts": [[name.capitalize(), text] for name, text in facts.items() if text],
        "not_stated": [name for name, text in facts.items() if not text],
        "warnings": run["warnings"],
        "run": _run_rows(review, state, run),
        "summary": _summary(rows),
        "metrics": {m["name"]: m["value"] for m in record["metrics"] if m["name"] in _METRICS},
        "instrument": _instrument(record["probe"]["calibrated_from"]),
        "diagnosis": _diagnosis(run["diagnosis"]),
        "strength_assumptions": ASSUMPTIONS if any(r["b31g_mpa"] is not None for r in rows) else "",
        "has_loss": any(r["wall_loss_percent"] is not None for r in rows),
        "assumed": state.assumed.model_dump(exclude={"do"}),
        "findings": [row | {"statement": said.get(row["id"], ""), "texts": _sentences(row)} for row in rows],
        "decisions": _decisions(state, {row["id"]: row["label"] for row in rows}),
        "signed": seal.signed,
        "signature": asdict(seal.signature) if seal.signature else None,
        "signature_told": _signature(seal.signed, seal.signature),
        "sha256": seal.sha256,
    })  # fmt: skip


def _run_rows(review: Review, state: State, run: dict[str, Any]) -> list[list[str]]:
    """Return names and values of the known facts of the pipe and of the measurement."""
    metrics = {m["name"]: f"{m['value']} {m['unit']}".strip() for m in run["metrics"]}
    first, last = run["distance_mm"]
    rows = [
        ("Nominal diameter", f"{run['nominal_diameter_mm']:g} mm"),
        ("Mean diameter", notation.measured(*mean_diameter(review.files.artefact(Wall).radius_map))),
        ("Inspected", f"{first:.1f}–{last:.1f} mm"),
        ("Wall seen", metrics.get("wall seen", "")),
        ("1 σ of the radius, median", metrics.get("median 1 σ of the radius", "")),
        ("Wall thickness, stated", _given(state.assumed.wall_thickness_mm, "mm")),
        ("Yield strength, stated", _given(state.assumed.yield_mpa, "MPa")),
    ]
    return [[name, text] for name, text in rows if text]


def _given(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:g} {unit}"


def _summary(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Return the numbers of findings by decision, and the deepest and highest of those not rejected."""
    count = Counter(row["status"] for row in rows)
    out = [[f"Findings {word}", str(count[status])] for status, word in _STATUS.items()]
    left = [r for r in rows if r["status"] != REJECTED and r["depth_mm"] is not None]
    for name, sign in (("Deepest", 1), ("Highest inward", -1)):
        of_sign = [r for r in left if sign * r["depth_mm"] > 0]
        if of_sign:
            row = max(of_sign, key=lambda r: abs(r["depth_mm"]))
            out.append([name, f"{notation.depth(row['depth_mm'], row['depth_sigma_mm'])}, "
                              f"finding {row['label']} ({row['kind']})"])  # fmt: skip
    return out


def _sentences(row: dict[str, Any]) -> dict[str, str]:
    """Return the texts on a finding that every report uses."""
    size = f"{row['length_mm']} mm along × {row['width_mm']} mm around"
    pressure = ""
    if row["b31g_mpa"] is not None:
        pressure = (
            f"Estimated failure pressure {row['b31g_mpa']:.1f} MPa (B31G), "
            f"{row['modified_b31g_mpa']:.1f} MPa (modified B31G)"
        )
    loss = row["wall_loss_percent"]
    return {
        "status": _STATUS[row["status"]],
        "where": notation.distance(row["distance_mm"], row["distance_from_mm"], row["distance_to_mm"]),
        "clock": _clock(row),
        "depth": notation.depth(row["depth_mm"], row["depth_sigma_mm"]),
        "size": size,
        "loss": "" if loss is None else notation.measured(loss, row["wall_loss_sigma_percent"], "%"),
        "pressure": pressure,
        "measured": _as_measured(row),
        "decided": f"by {row['decided_by']}, {notation.moment(row['decided_at'])}"
        if row["decided_by"]
        else "",
    }


def _clock(row: dict[str, Any]) -> str:
    extent = "all round" if row["clock_from"] == row["clock_to"] else f"{row['clock_from']}–{row['clock_to']}"
    return extent if row["clock"] is None else f"{row['clock']} ({extent})"


def _as_measured(row: dict[str, Any]) -> str:
    """Return the run's measurement of a finding that was edited since."""
    if not row["edited"]:
        return ""
    if row["measured_kind"] is None:
        return "drawn by hand: the run has no such finding"
    depth = notation.depth(row["measured_depth_mm"], row["measured_depth_sigma_mm"])
    return (
        f"{row['measured_kind']}, {depth}, "
        f"{row['measured_length_mm']} mm along × {row['measured_width_mm']} mm around"
    )


def _instrument(calibrated_from: str) -> str:
    return f"Calibrated on {calibrated_from}." if calibrated_from else NOT_CALIBRATED


def _diagnosis(diagnosis: dict[str, Any] | None) -> str:
    if diagnosis is None:
        return "Instrument diagnosis: not run."
    statement = f"Instrument diagnosis: {diagnosis['verdict']}. {diagnosis['statement']}"
    return statement.strip()


def _decisions(state: State, labels: dict[str, str]) -> list[list[str]]:
    """Return when, who and what of every decision that counts, in order."""
    return [[notation.moment(e.at), e.who, _in_words(e, labels)] for e in state.entries]


_WORDS_OF_ACTIONS = {
    "accept": "accepted finding {name}", "reject": "rejected finding {name}: {reason}",
    "reopen": "opened finding {name} again", "reclassify": "classed finding {name} as {kind}",
    "redraw": "drew the outline of finding {name} again", "split": "split finding {name}",
    "comment": "remarked on finding {name}: {text}", "merge": "merged findings {names}",
    "add": "added a {kind} as finding {made}",
    "assume": "stated pipe data: {pipe}", "describe": "stated the facts of the inspection",
}  # fmt: skip


def _in_words(entry: Entry, labels: dict[str, str]) -> str:
    """Return a sentence that describes an action."""
    said = entry.action.model_dump(mode="json")
    values = {k: v for k, v in said.items() if isinstance(v, str)}
    values["name"] = labels.get(str(said.get("finding")), str(said.get("finding")))
    values["made"] = labels.get(f"a{entry.id}", "")
    values["names"] = ", ".join(labels.get(f, f) for f in said.get("findings", ()))
    units = {"wall_thickness_mm": "mm wall thickness", "yield_mpa": "MPa yield strength"}
    values["pipe"] = ", ".join(_given(said[k], unit) for k, unit in units.items() if said.get(k)) or "none"
    return _WORDS_OF_ACTIONS[entry.action.do].format(**values)


def _revision(seal: Seal) -> str:
    """Return the revision of the report: each signature makes one; an unsigned state is a draft."""
    if seal.signature is None:
        return "Draft"
    return f"Revision {seal.signature.id}" if seal.signed else f"Draft after revision {seal.signature.id}"


def _signature(signed: bool, signature: Any) -> str:
    if signature is None:
        return "Not signed."
    if not signed:
        return f"Not signed. Changed since {signature.name} signed."
    standard = f", standard applied: {signature.standard}" if signature.standard else ""
    remarks = f" Remarks: {signature.remarks}" if signature.remarks else ""
    return f"Signed by {signature.name}, {notation.moment(signature.at)}{standard}.{remarks}"
