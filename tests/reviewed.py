"""A signed review with every kind of decision, and its papers as text."""

from __future__ import annotations

import csv
import html
import re
import shutil
from io import BytesIO, StringIO
from pathlib import Path

from pypdf import PdfReader

from pipeline.review import decisions as do
from pipeline.review.decisions.replay import Finding
from pipeline.review.review import Review, open_review
from pipeline.review.run_files import RunFiles

REMARK = '#let x = 1 $sum$ <b>bold</b> "quoted" \\ *star*'


def reviewed(sample: Path, run: Path) -> Review:
    """Return the review of a copy of the sample's run."""
    shutil.copytree(sample, run)
    review = open_review(RunFiles(run))
    first = review.state().findings[0]
    missed = ((50.0, 1.0), (58.0, 1.0), (58.0, 1.2), (50.0, 1.2))
    for action in (
        do.Describe(client="Water Works", line="A 12", operator="G. Hopper", date="2026-05-31"),
        do.Assume(wall_thickness_mm=6, yield_mpa=360),
        do.Redraw(finding="1", outline=tuple((s + 1.0, a) for s, a in first.outline)),
        do.Accept(finding="1"),
        do.Comment(finding="1", text=REMARK),
        do.Reject(finding="2", reason="a fitting"),
        do.Reclassify(finding="3", kind="pit"),
        do.Add(kind="gouge", outline=missed),
    ):
        review.act(action, "Ada", review.state().revision)
    review.sign("Ada Lovelace", "POF 100", "dry", review.state().revision)
    return review


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def pdf_text(pdf: bytes) -> str:
    return plain(" ".join(page.extract_text() for page in PdfReader(BytesIO(pdf)).pages))


def html_text(page: bytes) -> str:
    body = page.decode().split("<body>")[1]
    return plain(html.unescape(re.sub(r"<[^>]*>", " ", re.sub(r'src="[^"]*"', "", body))))


def rows_of(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(content.decode("utf-8-sig"))))


def standing(review: Review) -> list[Finding]:
    return [f for f in review.state().findings if f.status != "gone"]


def has(text: str, words: str) -> bool:
    """Return whether a text contains some words; a PDF breaks lines in cells, also after a dash."""
    return re.sub(r"\s", "", words) in re.sub(r"\s", "", text)
