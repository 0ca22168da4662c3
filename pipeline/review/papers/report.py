"""What an inspector takes away: the report as PDF and HTML, tables and pictures, all from one set of data."""

from __future__ import annotations

import base64
import json
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import typst
from jinja2 import Environment, StrictUndefined

from pipeline.artefacts.model import Overlays
from pipeline.errors import InputError
from pipeline.review.decisions.replay import ACCEPTED, OPEN, REJECTED, Finding
from pipeline.review.documents import ASSUMPTIONS, cleaned, run_document
from pipeline.review.papers.tables import (
    POF_COLUMNS,
    clock_text,
    csv_text,
    finding_picture,
    findings_table,
    pof_rows,
    section_plot,
)
from pipeline.review.review import Review, State

_HEADLINE_METRICS = 14
# Headline numbers of the run as measured: the papers tell those of the findings as decided.
_OF_FINDINGS = ("defects", "deepest defect")


def report_data(review: Review, state: State) -> dict[str, Any]:
    """Return all that the report tells."""
    run, seal = run_document(review.files), review.seal(state)
    rows = findings_table(review, state)
    edited = {row["id"] for row in rows if row["edited"]}
    said = {str(d["id"]): d["statement"] for d in run["defects"] if str(d["id"]) not in edited}
    return cleaned({
        "name": run["name"],
        "nominal_diameter_mm": run["nominal_diameter_mm"],
        "distance_mm": run["distance_mm"],
        "metrics": [*_of_the_run(run["metrics"]), *_decided(rows)],
        "program": run["program"],
        "diagnosis": run["diagnosis"],
        "strength_assumptions": ASSUMPTIONS,
        "assumed": state.assumed.model_dump(exclude={"do"}),
        "findings": [row | {"statement": said.get(row["id"], "")} for row in rows],
        "signed": seal.signed,
        "signature": asdict(seal.signature) if seal.signature else None,
        "sha256": seal.sha256,
    })  # fmt: skip


def _of_the_run(metrics: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the run's headline numbers without those of its findings, which decisions may have changed."""
    return [m for m in metrics[:_HEADLINE_METRICS] if m["name"] not in _OF_FINDINGS]


def _decided(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return how many findings were decided how, and the deepest of those not rejected."""
    count = Counter(row["status"] for row in rows)
    told = [("accepted", ACCEPTED), ("rejected", REJECTED), ("undecided", OPEN)]
    out = [{"name": f"findings {word}", "value": count[status], "unit": ""} for word, status in told]
    depths = [abs(r["depth_mm"]) for r in rows if r["status"] != REJECTED and r["depth_mm"] is not None]
    if depths:
        out.append({"name": "largest depth or height not rejected", "value": max(depths), "unit": "mm"})
    return out


def pictures(review: Review, state: State) -> dict[str, bytes]:
    """Return the pictures of every finding that was not rejected, by file name."""
    overlays, wall = review.files.artefact(Overlays), review.wall()
    made: dict[str, bytes] = {}
    for finding in pictured(state):
        distance, azimuth = (float(v) for v in np.mean(np.asarray(finding.outline), axis=0))
        made[f"{finding.id}.jpg"] = finding_picture(review.files, finding, overlays.nominal_radius_mm)
        made[f"{finding.id}.svg"] = section_plot(wall, overlays, distance, azimuth)
    return made


def pictured(state: State) -> tuple[Finding, ...]:
    """Return the findings that the papers show."""
    return tuple(f for f in state.findings if f.status not in (REJECTED, "gone"))


def pdf_report(review: Review, state: State) -> bytes:
    """Return the report as PDF; names and remarks reach the page as data, never as markup.

    Raises
    ------
    OSError
        When the temporary folder cannot be written.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "data.json").write_text(json.dumps(_with_pictures(review, state)), "utf-8")
        for file, content in pictures(review, state).items():
            (folder / file).write_bytes(content)
        template = files("pipeline.review.papers").joinpath("report.typ").read_bytes()
        (folder / "report.typ").write_bytes(template)
        made = typst.compile(str(folder / "report.typ"), root=str(folder), ignore_system_fonts=True)
    return bytes(made)


def html_report(review: Review, state: State) -> str:
    """Return the report as one HTML file without scripts."""
    page = files("pipeline.review.papers").joinpath("report.html").read_text("utf-8")
    shown = {k: base64.b64encode(v).decode("ascii") for k, v in pictures(review, state).items()}
    environment = Environment(undefined=StrictUndefined, autoescape=True)
    return environment.from_string(page).render(
        d=_with_pictures(review, state), pictures=shown, hour=clock_text
    )


def pictures_archive(review: Review, state: State) -> bytes:
    """Return the pictures of the findings as a ZIP file; the same state gives the same bytes."""
    out = BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for file, content in sorted(pictures(review, state).items()):
            archive.writestr(zipfile.ZipInfo(file), content)
    return out.getvalue()


def _with_pictures(review: Review, state: State) -> dict[str, Any]:
    shown = {f.id for f in pictured(state)}
    data = report_data(review, state)
    return data | {"findings": [row | {"pictured": row["id"] in shown} for row in data["findings"]]}


@dataclass(frozen=True)
class Paper:
    """A file to take away; ``shown`` when a browser is to show rather than to save it."""

    name: str
    media_type: str
    content: bytes
    shown: bool = False


def paper_of(name: str, review: Review, state: State) -> Paper:
    """Return a paper of a review.

    Raises
    ------
    InputError
        When there is none of that name.
    """
    if name not in PAPERS:
        raise InputError("papers", f"there is no {name[:40]!r}", expected=", ".join(PAPERS))
    media_type, shown, make = PAPERS[name]
    return Paper(name, media_type, make(review, state), shown)


def _csv(review: Review, state: State) -> bytes:
    return csv_text(findings_table(review, state)).encode("utf-8-sig")


def _json(review: Review, state: State) -> bytes:
    return json.dumps(report_data(review, state), indent=1, ensure_ascii=False, allow_nan=False).encode()


def _pof(review: Review, state: State) -> bytes:
    return csv_text(pof_rows(findings_table(review, state), state), POF_COLUMNS).encode("utf-8-sig")


def _html(review: Review, state: State) -> bytes:
    return html_report(review, state).encode()


PAPERS: dict[str, tuple[str, bool, Callable[[Review, State], bytes]]] = {
    "report.pdf": ("application/pdf", True, pdf_report),
    "report.html": ("text/html", False, _html),
    "findings.csv": ("text/csv", False, _csv),
    "findings.json": ("application/json", False, _json),
    "pof.csv": ("text/csv", False, _pof),
    "pictures.zip": ("application/zip", False, pictures_archive),
}
