"""The papers of a review: one set of numbers in all of them, fonts in the PDF, text as text."""

from __future__ import annotations

import csv
import json
import re
import shutil
import zipfile
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pypdf import PdfReader
from pypdf.generic import DictionaryObject

from pipeline.review.decisions import actions as do
from pipeline.review.papers.report import PAPERS, paper_of
from pipeline.review.review import Review, open_review
from pipeline.review.run_files import RunFiles

REMARK = '#let x = 1 $sum$ <b>bold</b> "quoted" \\ *star*'


@pytest.fixture(scope="module")
def review(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Review:
    """A review with every kind of decision, signed."""
    run = tmp_path_factory.mktemp("papers") / "run"
    shutil.copytree(sample, run)
    review = open_review(RunFiles(run))
    missed = ((50.0, 1.0), (58.0, 1.0), (58.0, 1.2), (50.0, 1.2))
    for action in (
        do.Assume(wall_thickness_mm=6, yield_mpa=360),
        do.Accept(finding="1"),
        do.Comment(finding="1", text=REMARK),
        do.Reject(finding="2", reason="a fitting"),
        do.Reclassify(finding="3", kind="pit"),
        do.Add(kind="gouge", outline=missed),
    ):
        review.act(action, "Ada", review.state().revision)
    review.sign("Ada Lovelace", "POF 100", "dry", review.state().revision)
    return review


@pytest.fixture(scope="module")
def papers(review: Review) -> dict[str, bytes]:
    return {name: paper_of(name, review, review.state()).content for name in PAPERS}


def pdf_text(papers: dict[str, bytes]) -> str:
    pages = PdfReader(BytesIO(papers["report.pdf"])).pages
    return re.sub(r"\s+", " ", " ".join(page.extract_text() for page in pages)).replace("−", "-")


def rows_of(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(content.decode("utf-8-sig"))))


def shown(value: Any) -> str:
    """Return a number as the papers print it."""
    return str(int(value)) if float(value) == int(value) else str(value)


def test_csv_and_json_hold_the_same_numbers(papers: dict[str, bytes]) -> None:
    table, data = rows_of(papers["findings.csv"]), json.loads(papers["findings.json"])["findings"]
    assert [r["id"] for r in table] == [f["id"] for f in data]
    assert len(table) == 4
    for row, finding in zip(table, data, strict=True):
        for name, text in row.items():
            value = finding[name]
            if isinstance(value, float | int) and not isinstance(value, bool):
                assert float(text) == value, name
            else:
                assert text.removeprefix("'") == ("" if value is None else str(value)), name


def test_the_pdf_shows_those_numbers(papers: dict[str, bytes]) -> None:
    text, data = pdf_text(papers), json.loads(papers["findings.json"])
    for f in data["findings"]:
        number = {k: shown(v) for k, v in f.items() if isinstance(v, float | int) and not isinstance(v, bool)}
        line = (
            rf"{f['id']} {f['kind']} {f['status']} {number['distance_from_mm']} to {number['distance_to_mm']}"
        )
        depth = rf"{number['depth_mm']} ± {number['depth_sigma_mm']} mm"
        size = rf"{number['length_mm']} × {number['width_mm']} {number.get('wall_loss_percent', '–')}"
        found = re.search(rf"{re.escape(line)} \S+ {re.escape(depth)} {re.escape(size)}", text)
        assert found, line
    for f in data["findings"]:
        if f["b31g_mpa"] is not None and f["status"] != "rejected":
            assert f"pressure {shown(f['b31g_mpa'])} MPa (B31G), {shown(f['modified_b31g_mpa'])} MPa" in text
    for metric in data["metrics"]:
        assert f"{metric['name']} {shown(metric['value'])} {metric['unit']}".strip() in text
    assert data["sha256"] in text.replace(" ", "")


def test_the_papers_count_what_was_decided_not_what_was_measured(papers: dict[str, bytes]) -> None:
    data = json.loads(papers["findings.json"])
    told = {m["name"]: m["value"] for m in data["metrics"]}
    status = [f["status"] for f in data["findings"]]
    assert told["findings rejected"] == status.count("rejected") > 0
    assert told["findings accepted"] == status.count("accepted")
    assert told["findings undecided"] == status.count("open")
    left = [abs(f["depth_mm"]) for f in data["findings"] if f["status"] != "rejected"]
    assert told["largest depth or height not rejected"] == max(left)
    assert not {"defects", "deepest defect"} & set(told)


def test_html_and_pof_show_those_numbers(papers: dict[str, bytes]) -> None:
    html, data = papers["report.html"].decode(), json.loads(papers["findings.json"])["findings"]
    for f in data:
        assert (
            f"<td>{f['depth_mm']} ± {f['depth_sigma_mm']}</td><td>{f['length_mm']} × {f['width_mm']}</td>"
            in html
        )
    accepted = {f["id"]: f for f in data if f["status"] == "accepted"}
    features = rows_of(papers["pof.csv"])
    assert [r["feature_id"] for r in features] == list(accepted)
    for row in features:
        finding = accepted[row["feature_id"]]
        assert float(row["depth_mm"]) == finding["depth_mm"]
        assert float(row["log_distance_m"]) == pytest.approx(finding["distance_from_mm"] / 1000, abs=1e-9)
        assert float(row["depth_tolerance_mm_80"]) == pytest.approx(
            1.2816 * finding["depth_sigma_mm"], abs=6e-4
        )


def test_who_decided_what_and_who_signed_is_in_every_report(papers: dict[str, bytes]) -> None:
    for text in (pdf_text(papers), papers["report.html"].decode()):
        assert "by Ada Lovelace" in text
        assert "standard applied: POF 100" in text
        assert "a fitting" in text
    assert REMARK in pdf_text(papers), "a remark is text, never markup"


def test_a_change_after_the_signature_shows(review: Review) -> None:
    review.act(do.Reopen(finding="1"), "Bo", review.state().revision)
    try:
        text = pdf_text({"report.pdf": paper_of("report.pdf", review, review.state()).content})
    finally:
        review.act(do.Undo(), "Bo", review.state().revision)
    assert "Not signed. Changed since Ada Lovelace signed." in text
    assert review.seal(review.state()).signed


def fonts_of(resources: DictionaryObject) -> list[DictionaryObject]:
    return [font.get_object() for font in resources.get("/Font", {}).values()]


def test_every_font_is_embedded(papers: dict[str, bytes]) -> None:
    reader = PdfReader(BytesIO(papers["report.pdf"]))
    fonts = [font for page in reader.pages for font in fonts_of(page["/Resources"])]
    assert len(fonts) >= 2
    for font in fonts:
        inner = font["/DescendantFonts"][0].get_object() if "/DescendantFonts" in font else font
        descriptor = inner["/FontDescriptor"].get_object()
        assert {"/FontFile", "/FontFile2", "/FontFile3"} & set(descriptor), font["/BaseFont"]


def test_every_finding_that_stands_has_its_picture(papers: dict[str, bytes]) -> None:
    with zipfile.ZipFile(BytesIO(papers["pictures.zip"])) as archive:
        names = sorted(archive.namelist())
        assert names == sorted(f"{f}.{kind}" for f in ("1", "3", "a6") for kind in ("jpg", "svg"))
        for name in names:
            if name.endswith(".jpg"):
                picture = cv2.imdecode(np.frombuffer(archive.read(name), np.uint8), cv2.IMREAD_COLOR)
                assert picture.std() > 5, "something is to be seen"


def test_the_same_state_gives_the_same_papers(review: Review, papers: dict[str, bytes]) -> None:
    for name in ("findings.csv", "findings.json", "pof.csv", "pictures.zip"):
        assert paper_of(name, review, review.state()).content == papers[name], name
