"""The papers of a review: worked out from the decisions, the same in all of them, and fit to be kept."""

from __future__ import annotations

import csv
import html
import json
import re
import shutil
import zipfile
from collections import Counter
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from pypdf import PdfReader
from pypdf.generic import DictionaryObject

from pipeline.artefacts.measured import Wall
from pipeline.pages import notation
from pipeline.review.decisions import actions as do
from pipeline.review.decisions.replay import Finding
from pipeline.review.papers.content import report_content
from pipeline.review.papers.exchange import EN_COLUMNS, EN_HEADER, PACP_COLUMNS, POF_COLUMNS
from pipeline.review.papers.pictures import canvas_of
from pipeline.review.papers.report import PAPERS, paper_of
from pipeline.review.review import Review, open_review
from pipeline.review.run_files import RunFiles, measured_findings

REMARK = '#let x = 1 $sum$ <b>bold</b> "quoted" \\ *star*'
# Fields of EN 13508-2 and columns of PACP's exchange database, as other programs read them: for the first
# KWB-R/kwb.en13508.2, inst/extdata/eucodes.csv.
EN_KNOWN = {
    "AAA", "AAB", "AAD", "AAF", "AAK", "AAM", "AAN", "AAP", "ABA", "ABC", "ABE", "ABF", "ABG", "ABH", "ABQ",
    "ACA", "ACB", "ACC", "ACD",
}  # fmt: skip
EN_OBSERVED = set("ABCDEFGHIJKLMN")
EN_CODES = {"BAA", "BAB", "BAF", "BBB", "BDB"}
PACP_KNOWN = [
    "ConditionID", "InspectionID", "Distance", "Counter", "PACP_Code", "Continuous", "Value_1st_Dimension",
    "Value_2nd_Dimension", "Value_Percent", "Joint", "Clock_At_From", "Clock_To", "Remarks", "VCR_Time",
]  # fmt: skip


@pytest.fixture(scope="module")
def review(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Review:
    """A review with every kind of decision, signed."""
    run = tmp_path_factory.mktemp("papers") / "run"
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


@pytest.fixture(scope="module")
def papers(review: Review) -> dict[str, bytes]:
    return {name: paper_of(name, review, review.state()).content for name in PAPERS}


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def pdf_text(pdf: bytes) -> str:
    return plain(" ".join(page.extract_text() for page in PdfReader(BytesIO(pdf)).pages))


def html_text(page: bytes) -> str:
    body = page.decode().split("<body>")[1]
    return plain(html.unescape(re.sub(r"<[^>]*>", " ", re.sub(r'src="[^"]*"', "", body))))


@pytest.fixture(scope="module")
def reports(papers: dict[str, bytes]) -> dict[str, str]:
    """The text of each report as a reader has it."""
    return {"PDF": pdf_text(papers["report.pdf"]), "HTML": html_text(papers["report.html"])}


def rows_of(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(content.decode("utf-8-sig"))))


def standing(review: Review) -> list[Finding]:
    return [f for f in review.state().findings if f.status != "gone"]


def has(text: str, words: str) -> bool:
    """Whether words are there; a PDF breaks lines in cells, also behind a dash."""
    return re.sub(r"\s", "", words) in re.sub(r"\s", "", text)


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


def test_every_paper_tells_of_each_finding_as_it_was_decided(
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


def test_every_report_counts_what_was_decided_not_what_was_measured(
    review: Review, reports: dict[str, str]
) -> None:
    count = Counter(f.status for f in standing(review))
    deepest = max((f for f in standing(review) if f.status != "rejected"), key=lambda f: f.size.depth_mm)
    rejected = next(f for f in standing(review) if f.status == "rejected")
    assert abs(rejected.size.depth_mm) > deepest.size.depth_mm, "or the test shows nothing"
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


def test_mean_diameter_and_wall_loss_bear_their_sigma(review: Review, reports: dict[str, str]) -> None:
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


def test_failure_pressure_is_an_estimate_without_the_sigma_of_the_depth(reports: dict[str, str]) -> None:
    for text in reports.values():
        told = re.findall(r"Estimated failure pressure ([\d.]+) MPa \(B31G\), ([\d.]+) MPa", text)
        assert len(told) == 2
        assert all(len(number.split(".")[1]) == 1 for pair in told for number in pair)
        assert "± 0.0" not in re.findall(r"Estimated failure pressure.{0,60}", text)[0]
        assert has(text, "the criteria's own scatter against burst tests is not included")


def test_who_decided_what_when_and_who_signed_is_in_every_report(
    review: Review, reports: dict[str, str]
) -> None:
    for text in reports.values():
        assert has(text, "Signed by Ada Lovelace")
        assert has(text, "standard applied: POF 100")
        assert has(text, REMARK), "a remark is text, never markup"
        for entry in review.state().entries:
            assert has(text, f"{notation.moment(entry.at)} {entry.who}")
        assert has(text, "rejected finding 2: a fitting")
        assert has(text, "added a gouge as finding 4 (added)")


def test_the_facts_of_the_inspection_and_what_is_missing_are_told(reports: dict[str, str]) -> None:
    for text in reports.values():
        for words in ("Client Water Works", "Line A 12", "Operator G. Hopper", "Date 2026-05-31"):
            assert has(text, words)
        assert has(text, "Not stated: site, asset, procedure, equipment, calibration.")
        assert has(text, "not calibrated on a gauge")
        assert has(text, "Instrument diagnosis: not run.")


def test_a_change_after_the_signature_shows(review: Review) -> None:
    review.act(do.Reopen(finding="1"), "Bo", review.state().revision)
    try:
        text = pdf_text(paper_of("report.pdf", review, review.state()).content)
    finally:
        review.act(do.Undo(), "Bo", review.state().revision)
    assert "Not signed. Changed since Ada Lovelace signed." in text
    assert "Draft after revision 1, not signed" in text
    assert review.seal(review.state()).signed


def fonts_of(resources: DictionaryObject) -> list[DictionaryObject]:
    return [font.get_object() for font in resources.get("/Font", {}).values()]


def test_the_pdf_is_fit_to_be_kept(papers: dict[str, bytes]) -> None:
    reader = PdfReader(BytesIO(papers["report.pdf"]))
    metadata = reader.trailer["/Root"]["/Metadata"].get_object().get_data().decode()
    assert re.search(r"pdfaid:part\W+2\W", metadata), "PDF/A-2"
    assert re.search(r"pdfaid:conformance\W+U\W", metadata)
    assert "/OutputIntents" in reader.trailer["/Root"]
    fonts = [font for page in reader.pages for font in fonts_of(page["/Resources"])]
    assert len(fonts) >= 2
    for font in fonts:
        inner = font["/DescendantFonts"][0].get_object() if "/DescendantFonts" in font else font
        descriptor = inner["/FontDescriptor"].get_object()
        assert {"/FontFile", "/FontFile2", "/FontFile3"} & set(descriptor), font["/BaseFont"]
    for number, page in enumerate(reader.pages, 1):
        text = page.extract_text()
        assert f"Page {number} of {len(reader.pages)}" in text
        assert "Revision 1, signed" in plain(text)


def pdfa_faults(pdf: bytes) -> list[str]:
    """Return what of ISO 19005-2 a PDF breaks, by clause, as far as its objects show it.

    veraPDF is in no package index; these are the rules that a report could break: structure of the file,
    encryption, filters, colour, fonts with their meaning, actions, attachments, annotations, transparency.
    """
    reader, faults = PdfReader(BytesIO(pdf)), []
    root, head = reader.trailer["/Root"], pdf.split(b"\n", 2)
    rules = [
        ("6.1.2 header", bool(re.fullmatch(rb"%PDF-1\.[0-7]", head[0].strip()))),
        ("6.1.2 binary comment", head[1][:1] == b"%" and sum(b > 127 for b in head[1][1:5]) == 4),
        ("6.1.3 file identifier", "/ID" in reader.trailer),
        ("6.1.3 encryption", "/Encrypt" not in reader.trailer),
        ("6.1.3 data after the end", pdf.rstrip(b"\r\n").endswith(b"%%EOF")),
        ("6.5.1 no actions on opening", "/AA" not in root and not isinstance(root.get("/OpenAction"), dict)),
        ("6.6.2 metadata unfiltered", "/Filter" not in root["/Metadata"]),
        ("6.8 no attachments", "/EmbeddedFiles" not in root.get("/Names", {})),
        ("6.10 no XFA", "/AcroForm" not in root),
    ]
    intent = root["/OutputIntents"][0].get_object()
    rules.append(("6.2.3 output intent", intent["/S"] == "/GTS_PDFA1" and "/DestOutputProfile" in intent))
    for number in range(1, reader.trailer["/Size"]):
        thing = reader.get_object(number)
        if isinstance(thing, dict):
            rules += [(f"{clause} (object {number})", good) for clause, good in _object_rules(thing)]
    faults += [clause for clause, good in rules if not good]
    return faults


def _object_rules(thing: dict[str, Any]) -> list[tuple[str, bool]]:
    """Return which rules for single objects one keeps."""
    kind, sort = thing.get("/Type"), thing.get("/Subtype")
    filters = str(thing.get("/Filter", ""))
    rules = [
        ("6.1.7 no LZW", "/LZW" not in filters and "/Crypt" not in filters),
        ("6.2.4 no DeviceCMYK beside an RGB intent", "/DeviceCMYK" not in str(thing.get("/ColorSpace", ""))),
        (
            "6.5.1 action",
            thing.get("/S") not in ("/JavaScript", "/Launch", "/Sound", "/Movie", "/ImportData"),
        ),
        ("6.2.5 transfer function", "/TR" not in thing),
    ]
    if sort == "/Image":
        rules.append(("6.2.8 no interpolation", not thing.get("/Interpolate", False)))
    if kind == "/Annot" and sort != "/Popup":
        rules.append(("6.3.2 annotations print", thing.get("/F", 0) & 0b100110 == 0b100))
    if kind == "/Font" and sort in ("/Type0", "/TrueType", "/Type1"):
        rules.append(("6.2.11.7 characters have a meaning", "/ToUnicode" in thing))
    if kind == "/FontDescriptor":
        rules.append(("6.2.11.4 font inside", bool({"/FontFile", "/FontFile2", "/FontFile3"} & set(thing))))
    return rules


def test_the_pdf_keeps_the_rules_of_pdf_a(papers: dict[str, bytes]) -> None:
    pdf = papers["report.pdf"]
    assert pdfa_faults(pdf) == []
    spoiled = {
        "6.1.2 header": pdf.replace(b"%PDF-1.7", b"%PDF-2.7", 1),
        "6.1.3 data after the end": pdf + b"x",
        "6.2.3 output intent": pdf.replace(b"/GTS_PDFA1", b"/GTS_PDFX01"[:10], 1),
        "6.2.11.7": pdf.replace(b"/ToUnicode", b"/ToUnicorn"),
    }
    for clause, other in spoiled.items():
        assert any(clause in fault for fault in pdfa_faults(other)), f"the control: {clause}"


def test_the_colours_of_a_finding_s_picture_hold_its_depth(review: Review) -> None:
    canvas = canvas_of(review.files)
    deepest = max(abs(f.size.depth_mm) for f in standing(review))
    assert canvas.limits.high_mm == -canvas.limits.low_mm
    assert canvas.limits.high_mm >= 0.9 * deepest, "a depth is read from points, colours from cells' means"


def test_the_whole_wall_and_every_finding_that_stands_have_their_picture(papers: dict[str, bytes]) -> None:
    with zipfile.ZipFile(BytesIO(papers["pictures.zip"])) as archive:
        assert sorted(archive.namelist()) == sorted(
            ["overview.svg", *(f"finding-{f}.svg" for f in ("1", "3", "a8"))]
        )
        for name in archive.namelist():
            root = ElementTree.fromstring(archive.read(name))
            rasters = [e for e in root.iter() if e.tag.endswith("}image")]
            assert len(rasters) >= (1 if name == "overview.svg" else 3), "photo, deviation and legend"


def test_pof_columns_are_those_of_its_pipe_tally(review: Review, papers: dict[str, bytes]) -> None:
    accepted = [f for f in standing(review) if f.status == "accepted"]
    rows = rows_of(papers["pof.csv"])
    assert tuple(rows[0]) == POF_COLUMNS
    assert len(rows) == len(accepted) == 2
    for row, finding in zip(rows, accepted, strict=True):
        assert float(row["Log distance [m]"]) == pytest.approx(finding.size.peak_distance_mm / 1000, abs=1e-4)
        assert re.fullmatch(r"(1[0-2]|[1-9]):[0-5]\d", row["Clock position"])
        assert row["Anomaly dimension class"] in {"GENE", "PITT", "PINH", "AXGR", "AXSL", "CIGR", "CISL"}
        if finding.size.depth_mm > 0:
            assert float(row["Max. depth [mm]"]) == pytest.approx(finding.size.depth_mm, abs=5e-4)
            assert float(row["Max. depth [%.t]"]) == pytest.approx(finding.size.depth_mm / 0.06, abs=0.05)
            tolerance = 1.2816 * finding.size.depth_sigma_mm
            assert float(row["Depth tolerance at 80 % [mm]"]) == pytest.approx(tolerance, abs=1e-3)
        else:
            assert row["Max. depth [mm]"] == "", "no loss was measured there"


def test_pacp_rows_fit_the_table_conditions(papers: dict[str, bytes]) -> None:
    rows = rows_of(papers["pacp.csv"])
    assert list(rows[0]) == list(PACP_COLUMNS) == PACP_KNOWN
    for number, row in enumerate(rows, 1):
        assert int(row["ConditionID"]) == number
        assert 0 <= float(row["Distance"]) < 1
        assert row["PACP_Code"].isalpha()
        assert all(row[c] == "" or 1 <= int(row[c]) <= 12 for c in ("Clock_At_From", "Clock_To"))
        assert len(row["Remarks"]) <= 255


def test_the_file_of_en_13508_has_its_blocks_and_known_fields(papers: dict[str, bytes]) -> None:
    lines = papers["en13508-2.txt"].decode("iso-8859-1").splitlines()
    assert [line[:4] for line in lines[:6]] == [f"#A{k}=" for k in range(1, 7)]
    separator = lines[2].split("=")[1]
    inspection, observed, end = (next(k for k, text in enumerate(lines) if text.startswith(b))
                                 for b in ("#B01=", "#C=", "#Z"))  # fmt: skip
    assert lines[inspection][5:].split(separator) == list(EN_HEADER)
    assert set(EN_HEADER) <= EN_KNOWN
    assert lines[observed][3:].split(separator) == list(EN_COLUMNS)
    assert set(EN_COLUMNS) <= EN_OBSERVED
    (header,) = csv.DictReader(lines[inspection + 1 : observed], EN_HEADER, delimiter=separator)
    assert (header["AAA"], header["AAM"], header["ABF"]) == ("A 12", "Water Works", "2026-05-31")
    rows = list(csv.DictReader(lines[observed + 1 : end], EN_COLUMNS, delimiter=separator))
    assert len(rows) == 2
    for row in rows:
        assert row["A"] in EN_CODES
        assert 0 <= float(row["I"]) <= float(header["ABQ"])
        assert all(row[c] == "" or 1 <= int(row[c]) <= 12 for c in "GH")


def test_the_same_state_gives_the_same_papers(review: Review, papers: dict[str, bytes]) -> None:
    for name in set(PAPERS) - {"report.pdf"}:
        assert paper_of(name, review, review.state()).content == papers[name], name


def test_shown_values_are_plain(papers: dict[str, bytes]) -> None:
    data: dict[str, Any] = json.loads(papers["findings.json"])
    for text in json.dumps(data["run"]), json.dumps(data["summary"]):
        assert "nan" not in text.lower()
        assert "None" not in text


def test_nothing_half_empty_where_no_wall_thickness_is_known(sample: Path, tmp_path: Path) -> None:
    shutil.copytree(sample, tmp_path / "run")
    review = open_review(RunFiles(tmp_path / "run"))
    unknown = do.Assume(wall_thickness_mm=None, yield_mpa=None)
    told = report_content(review, review.act(unknown, "Ada", review.state().revision))
    assert not told["has_loss"]
    assert told["strength_assumptions"] == ""
