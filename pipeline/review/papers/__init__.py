"""The downloads of a review: the report as PDF and HTML, tables and pictures, all from one content."""

from __future__ import annotations

import base64
import json
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
import typst
from jinja2 import Environment, StrictUndefined

from pipeline.errors import InputError
from pipeline.review.decisions.replay import GONE, REJECTED, Finding
from pipeline.review.papers.content import report_content
from pipeline.review.papers.exchange import en13508_text, pacp_text, pof_text
from pipeline.review.papers.pictures import canvas_of
from pipeline.review.review import Review, State
from pipeline.review.tables import csv_text, findings_table

OVERVIEW = "overview.svg"
# Number of findings with pictures, the deepest first: about 100 kB each, for a report that should open
# anywhere.
_MOST_PICTURED = 60
# PDF/A-2u: for archiving, with all fonts embedded and every character mapped to Unicode (ISO 19005-2).
_STANDARD: Literal["a-2u"] = "a-2u"


def pictures(review: Review, state: State) -> dict[str, bytes]:
    """Return the picture of the whole wall and one of every finding shown, by file name."""
    canvas, shown = canvas_of(review.files), pictured(state)
    labels = {row["id"]: row["label"] for row in findings_table(review, state)}
    named = [(labels[f.id].split(" ")[0], f) for f in state.findings if f.status not in (REJECTED, GONE)]
    return {OVERVIEW: canvas.overview(named)} | {picture_name(f.id): canvas.finding(f) for f in shown}


def pictured(state: State) -> tuple[Finding, ...]:
    """Return the findings with a picture in the reports: the deepest of those not rejected."""
    standing = [f for f in state.findings if f.status not in (REJECTED, GONE)]
    deepest = sorted(standing, key=lambda f: -abs(np.nan_to_num(f.size.depth_mm)))[:_MOST_PICTURED]
    return tuple(f for f in standing if f in deepest)


def picture_name(finding: str) -> str:
    """Return the file name of a finding's picture."""
    return f"finding-{finding}.svg"


def pdf_report(review: Review, state: State) -> bytes:
    """Return the report as PDF/A; names and remarks reach the page as data, never as markup.

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
        made = typst.compile(
            str(folder / "report.typ"), root=str(folder), ignore_system_fonts=True, pdf_standards=[_STANDARD]
        )
    return bytes(made)


def html_report(review: Review, state: State) -> str:
    """Return the report as one HTML file without scripts."""
    page = files("pipeline.review.papers").joinpath("report.html").read_text("utf-8")
    shown = {k: base64.b64encode(v).decode("ascii") for k, v in pictures(review, state).items()}
    environment = Environment(
        undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(page).render(d=_with_pictures(review, state), pictures=shown)


def pictures_archive(review: Review, state: State) -> bytes:
    """Return the pictures of the findings as a ZIP file; the same state gives the same bytes."""
    out = BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for file, content in sorted(pictures(review, state).items()):
            archive.writestr(zipfile.ZipInfo(file), content)
    return out.getvalue()


def _with_pictures(review: Review, state: State) -> dict[str, Any]:
    shown = {f.id for f in pictured(state)}
    data = report_content(review, state)
    rows = [r | {"picture": picture_name(r["id"]) if r["id"] in shown else ""} for r in data["findings"]]
    return data | {"findings": rows, "overview": OVERVIEW}


@dataclass(frozen=True)
class Paper:
    """A file of a review; ``shown`` if a browser displays it instead of saving it."""

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
    return json.dumps(report_content(review, state), indent=1, ensure_ascii=False, allow_nan=False).encode()


def _html(review: Review, state: State) -> bytes:
    return html_report(review, state).encode()


PAPERS: dict[str, tuple[str, bool, Callable[[Review, State], bytes]]] = {
    "report.pdf": ("application/pdf", True, pdf_report),
    "report.html": ("text/html", False, _html),
    "findings.csv": ("text/csv", False, _csv),
    "findings.json": ("application/json", False, _json),
    "pof.csv": ("text/csv", False, pof_text),
    "pacp.csv": ("text/csv", False, pacp_text),
    "en13508-2.txt": ("text/plain", False, en13508_text),
    "pictures.zip": ("application/zip", False, pictures_archive),
}
