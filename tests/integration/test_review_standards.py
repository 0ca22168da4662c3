"""The papers follow the standards that they name: PDF/A, and the tables of POF, PACP and EN 13508-2.

The lists of columns here are taken from the standards, not from the program.
"""

from __future__ import annotations

import csv
import re
import shutil
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader
from pypdf.generic import DictionaryObject

from pipeline.review import decisions as do
from pipeline.review.papers import paper_of
from pipeline.review.papers.exchange import EN_COLUMNS, EN_HEADER
from pipeline.review.review import Review, open_review
from pipeline.review.run_files import RunFiles
from tests.reviewed import plain, rows_of, standing

# Pipeline Operators Forum, Specifications and requirements for in-line inspection of pipelines, version 2016,
# appendix 6 "Typical example of Pipe tally": its heads from left to right, and the values its rows use.
POF_KNOWN = [
    "Log distance [m]",
    *("Latitude", "Longitude", "Altitude [m]"),  # GPS coordinates
    *("Feature type", "Feature identification", "Comment / Cluster ID"),
    *("Girth weld Nr", "Joint manufacturing type", "Joint / component length [m]"),  # reference joint
    *("Internal diameter [mm]", "Nominal thickness [mm]", "Measured/reference thickness [mm]"),
    *("Ovality [%]", "Bend Y/N"),  # joint global geometry
    *("Abs. Dist. to upstream weld [m]", "Clock position seam weld / anomaly", "Surface location"),
    *("Inward/outward", "Depth / height [%.D or mm]", "Size (length x width) [mm]"),  # deformations
    *(
        "Mean depth [%.t or mm]",
        "Max. depth [%.t or mm]",
        "Length [mm]",
        "Width [mm]",
    ),  # cracks, metal losses
    *(
        "Anomaly dimension classification",
        "ERF (metal losses)",
        "Reference table for performance",
        "Comments",
    ),
]
POF_CLASSES = {"GENE", "PITT", "PINH", "AXGR", "AXSL", "CIGR", "CISL"}
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


def fonts_of(resources: DictionaryObject) -> list[DictionaryObject]:
    return [font.get_object() for font in resources.get("/Font", {}).values()]


def test_the_pdf_is_suitable_for_archives(papers: dict[str, bytes]) -> None:
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
    """Return the clauses of ISO 19005-2 that a PDF violates, as far as its objects show.

    veraPDF is in no package index. These rules are the ones that a report could violate: structure of the
    file, encryption, filters, colour, fonts and their Unicode maps, actions, attachments, annotations,
    transparency.
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
    """Return for each rule on single objects whether one follows it."""
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


def test_planted_violations_of_pdf_a_are_found(papers: dict[str, bytes]) -> None:
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


def test_the_pipe_tally_has_the_columns_and_values_of_pof_2016(
    review: Review, papers: dict[str, bytes]
) -> None:
    accepted = [f for f in standing(review) if f.status == "accepted"]
    rows = rows_of(papers["pof.csv"])
    assert list(rows[0]) == POF_KNOWN
    assert len(rows) == len(accepted) == 2
    for row, finding in zip(rows, accepted, strict=True):
        depth, sigma = finding.size.depth_mm, finding.size.depth_sigma_mm
        assert float(row["Log distance [m]"]) == pytest.approx(finding.size.peak_distance_mm / 1000, abs=1e-4)
        assert re.fullmatch(r"(1[01]|\d):[0-5]\d", row["Clock position seam weld / anomaly"]), (
            "0:22, not 12:22"
        )
        assert row["Feature type"] == "Anomaly"
        assert row["Surface location"] == "Int"
        assert row["Anomaly dimension classification"] in POF_CLASSES
        assert row["ERF (metal losses)"] == "Not calculated"
        assert "(POF 2016, appendix 6)" in row["Comments"], "the file states the edition that it follows"
        assert f"depth ± {1.2816 * round(sigma, 3):.3f} mm at 80 % certainty" in row["Comments"]
        told = row["Max. depth [%.t or mm]"]
        assert told == (f"{depth / 0.06:.1f}%" if depth > 0 else ""), "empty where no loss was measured"
        assert not row["Inward/outward"] + row["Depth / height [%.D or mm]"], "for deformations only"


def test_a_dent_is_listed_under_deformations_in_the_pipe_tally(sample: Path, tmp_path: Path) -> None:
    shutil.copytree(sample, tmp_path / "run")
    review = open_review(RunFiles(tmp_path / "run"))
    dent = next(f for f in review.state().findings if f.kind == "dent")
    state = review.act(do.Accept(finding=dent.id), "Ada", 0)
    (row,) = rows_of(paper_of("pof.csv", review, state).content)
    assert row["Feature identification"] == "Dent"
    assert row["Inward/outward"] == ("Inw" if dent.size.depth_mm < 0 else "Outw")
    assert row["Depth / height [%.D or mm]"] == f"{round(abs(dent.size.depth_mm), 3)} mm"
    assert re.fullmatch(r"\d+x\d+", row["Size (length x width) [mm]"])
    assert not any(row[c] for c in ("Max. depth [%.t or mm]", "Length [mm]", "ERF (metal losses)"))


def test_pacp_rows_satisfy_the_conditions_of_the_table(papers: dict[str, bytes]) -> None:
    rows = rows_of(papers["pacp.csv"])
    assert list(rows[0]) == PACP_KNOWN
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
