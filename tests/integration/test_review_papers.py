"""The papers of a review: made from the decisions, consistent with each other, and suitable for archives."""

from __future__ import annotations

import json
import re
import shutil
import zipfile
from collections import Counter
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from pipeline.artefacts.measured import Wall
from pipeline.pages import notation
from pipeline.review import decisions as do
from pipeline.review.papers import PAPERS, paper_of
from pipeline.review.papers.content import report_content
from pipeline.review.papers.pictures import canvas_of
from pipeline.review.review import Review, open_review
from pipeline.review.run_files import RunFiles, measured_findings
from tests.reviewed import REMARK, has, html_text, pdf_text, rows_of, standing


@pytest.fixture(scope="module")
def reports(papers: dict[str, bytes]) -> dict[str, str]:
    """The text of each report."""
    return {"PDF": pdf_text(papers["report.pdf"]), "HTML": html_text(papers["report.html"])}


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


def test_every_paper_lists_each_finding_as_it_was_decided(
    review: Review, reports: dict[str, str], papers: dict[str, bytes]
) -> None:
    by_id = {r["id"]: r for r in rows_of(papers["findings.csv"])}
    for finding in standing(review):
        size = finding.size
        where = notation.distance(size.peak_distance_mm, size.distance_from_mm, size.distance_to_mm)
        depth = notation.depth(size.depth_mm, size.depth_sigma_mm)
        clock = notation.clock_extent(size.clock_from, size.clock_to)
        for name, text in reports.items():
            for words in (where, depth, clock):
                assert has(text, words), f"{name}: {words} of {finding.id}"
        row = by_id[finding.id]
        assert row["status"] == finding.status
        assert float(row["distance_mm"]) == pytest.approx(size.peak_distance_mm, abs=0.05)
        assert float(row["depth_mm"]) == pytest.approx(size.depth_mm, abs=5e-4)
        assert f"{row['clock_from']}–{row['clock_to']}" == clock


def test_every_report_counts_the_decided_findings_not_the_measured_ones(
    review: Review, reports: dict[str, str]
) -> None:
    count = Counter(f.status for f in standing(review))
    deepest = max((f for f in standing(review) if f.status != "rejected"), key=lambda f: f.size.depth_mm)
    rejected = next(f for f in standing(review) if f.status == "rejected")
    assert abs(rejected.size.depth_mm) > deepest.size.depth_mm, "otherwise the test shows nothing"
    for text in reports.values():
        assert has(text, f"Findings accepted {count['accepted']}")
        assert has(text, f"Findings rejected {count['rejected']}")
        assert has(text, f"Findings not decided {count['open']}")
        assert has(text, f"Deepest {notation.depth(deepest.size.depth_mm, deepest.size.depth_sigma_mm)}")


def test_the_value_before_editing_stands_beside_the_edited_one(
    review: Review, reports: dict[str, str]
) -> None:
    text = review.files.defects_text()
    before = {f.id: f for f in measured_findings(text, review.files.path / "defects.json")}
    edited = [f for f in standing(review) if f.edited and f.id in before]
    assert {f.id for f in edited} == {"1", "3"}
    for finding in edited:
        run = before[finding.id]
        told = f"As measured: {run.kind}, {notation.depth(run.size.depth_mm, run.size.depth_sigma_mm)}"
        for name, text in reports.items():
            assert has(text, told), f"{name}: {told}"
    for text in reports.values():
        assert has(text, "drawn by hand")


def test_mean_diameter_and_wall_loss_have_their_sigma(review: Review, reports: dict[str, str]) -> None:
    wall = review.files.artefact(Wall).radius_map
    diameter = 2 * float(np.nanmean(wall.radius_mm))
    for text in reports.values():
        found = re.search(r"Mean diameter ([\d.]+) ± ([\d.]+) mm", text)
        assert found is not None
        assert float(found[1]) == pytest.approx(diameter, abs=2e-3)
        assert 0 < float(found[2]) < 1
        for finding in standing(review):
            if finding.kind == "pit":
                loss, sigma = 100 * finding.size.depth_mm / 6, 100 * finding.size.depth_sigma_mm / 6
                assert has(text, notation.measured(round(loss, 2), round(sigma, 2), "%"))


def test_failure_pressure_is_an_estimate_and_ignores_the_sigma_of_the_depth(reports: dict[str, str]) -> None:
    for text in reports.values():
        told = re.findall(r"Estimated failure pressure ([\d.]+) MPa \(B31G\), ([\d.]+) MPa", text)
        assert len(told) == 2
        assert all(len(number.split(".")[1]) == 1 for pair in told for number in pair)
        assert "± 0.0" not in re.findall(r"Estimated failure pressure.{0,60}", text)[0]
        assert has(text, "the criteria's own scatter against burst tests is not included")


def test_every_report_says_who_decided_what_when_and_who_signed(
    review: Review, reports: dict[str, str]
) -> None:
    for text in reports.values():
        assert has(text, "Signed by Ada Lovelace")
        assert has(text, "standard applied: POF 100")
        assert has(text, REMARK), "a remark is shown as text, never as markup"
        for entry in review.state().entries:
            assert has(text, f"{notation.moment(entry.at)} {entry.who}")
        assert has(text, "rejected finding 2: a fitting")
        assert has(text, "added a gouge as finding 4 (added)")


def test_the_facts_of_the_inspection_are_printed_and_missing_ones_are_named(reports: dict[str, str]) -> None:
    for text in reports.values():
        for words in ("Client Water Works", "Line A 12", "Operator G. Hopper", "Date 2026-05-31"):
            assert has(text, words)
        assert has(text, "Not stated: site, asset, procedure, equipment, calibration.")
        assert has(text, "not calibrated on a gauge")
        assert has(text, "Instrument diagnosis: not run.")


def test_a_change_after_the_signature_is_shown(review: Review) -> None:
    review.act(do.Reopen(finding="1"), "Bo", review.state().revision)
    try:
        text = pdf_text(paper_of("report.pdf", review, review.state()).content)
    finally:
        review.act(do.Undo(), "Bo", review.state().revision)
    assert "Not signed. Changed since Ada Lovelace signed." in text
    assert "Draft after revision 1, not signed" in text
    assert review.seal(review.state()).signed


def test_the_colour_range_of_a_finding_s_picture_covers_its_depth(review: Review) -> None:
    canvas = canvas_of(review.files)
    deepest = max(abs(f.size.depth_mm) for f in standing(review))
    assert canvas.limits.high_mm == -canvas.limits.low_mm
    assert canvas.limits.high_mm >= 0.9 * deepest, (
        "a depth is read from points, colours show the means of cells"
    )


def test_the_whole_wall_and_every_accepted_finding_have_a_picture(papers: dict[str, bytes]) -> None:
    with zipfile.ZipFile(BytesIO(papers["pictures.zip"])) as archive:
        assert sorted(archive.namelist()) == sorted(
            ["overview.svg", *(f"finding-{f}.svg" for f in ("1", "3", "a8"))]
        )
        for name in archive.namelist():
            root = ElementTree.fromstring(archive.read(name))
            rasters = [e for e in root.iter() if e.tag.endswith("}image")]
            assert len(rasters) >= (1 if name == "overview.svg" else 3), "photo, deviation and legend"


def test_the_same_state_gives_the_same_papers(review: Review, papers: dict[str, bytes]) -> None:
    for name in set(PAPERS) - {"report.pdf"}:
        assert paper_of(name, review, review.state()).content == papers[name], name


def test_displayed_numbers_are_formatted_plainly(papers: dict[str, bytes]) -> None:
    data: dict[str, Any] = json.loads(papers["findings.json"])
    for text in json.dumps(data["run"]), json.dumps(data["summary"]):
        assert "nan" not in text.lower()
        assert "None" not in text


def test_without_a_wall_thickness_there_are_no_half_empty_tables(sample: Path, tmp_path: Path) -> None:
    shutil.copytree(sample, tmp_path / "run")
    review = open_review(RunFiles(tmp_path / "run"))
    unknown = do.Assume(wall_thickness_mm=None, yield_mpa=None)
    told = report_content(review, review.act(unknown, "Ada", review.state().revision))
    assert not told["has_loss"]
    assert told["strength_assumptions"] == ""
