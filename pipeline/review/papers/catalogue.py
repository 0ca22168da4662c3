"""All papers by file name."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass

from pipeline.errors import InputError
from pipeline.review.papers import report
from pipeline.review.papers.tables import POF_COLUMNS, csv_text, findings_table, pof_rows
from pipeline.review.review import Review, State


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
    return json.dumps(
        report.report_data(review, state), indent=1, ensure_ascii=False, allow_nan=False
    ).encode()


def _pof(review: Review, state: State) -> bytes:
    return csv_text(pof_rows(findings_table(review, state), state), POF_COLUMNS).encode("utf-8-sig")


def _html(review: Review, state: State) -> bytes:
    return report.html_report(review, state).encode()


PAPERS: dict[str, tuple[str, bool, Callable[[Review, State], bytes]]] = {
    "report.pdf": ("application/pdf", True, report.pdf_report),
    "report.html": ("text/html", False, _html),
    "findings.csv": ("text/csv", False, _csv),
    "findings.json": ("application/json", False, _json),
    "pof.csv": ("text/csv", False, _pof),
    "pictures.zip": ("application/zip", False, report.pictures_archive),
}
