"""The page of a diagnosis: every verdict has a page, and missing numbers are marked as missing."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.api.diagnosis.apply import DefectChange, GeometryChange
from pipeline.api.diagnosis.report import Shown, headline, sizes, write_page
from stages.diagnose.compared import OnImage, worst_frame
from stages.diagnose.residual import RingResidual
from stages.diagnose.result import (
    Candidate,
    Confirmation,
    Diagnosis,
    EffectFound,
    Feasible,
    FitQuality,
    Location,
    Picture,
    Value,
    Verdict,
    WallPicture,
)

AZIMUTH = np.linspace(-np.pi, np.pi, 24, endpoint=False)
WAVE = 0.1 * np.cos(AZIMUTH)[None] * np.ones((5, 1))
RING = [40.0, 30.0] + 20 * np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)], 1)
HOLED = np.where(np.arange(24) == 3, np.nan, 0.01 * WAVE)
TILT = EffectFound(
    "laser_tilt", 0.99, {"tilt_deg": Value(0.6, 0.01)}, "The sheet leans by 0.600 ± 0.010°.", "δr = −r x",
    (Confirmation("0.60°", "0.61° in another bore", True), Confirmation("<b>ghost</b>", "not seen", False)),
)  # fmt: skip
WHOLE = Diagnosis(
    recording="field", gauge="gauge", verdict=Verdict.NAMED, global_p=1e-30,
    location=Location("ring", "laser", "static", 1, (2.0, 0.1), (0, 200), (0.0, 120.0), (-180.0, 180.0)),
    effects=(TILT,), fit=FitQuality("px", 0.4, 0.08, 0.41, 0.08, float("nan")),
    feasibility=(Feasible("laser_tilt", "tilt_deg", "deg", 0.02, 0.05, "principal_point", 0.4),),
    candidates=(Candidate(("laser_tilt",), 0.99, 900.0, 850.0, "x"), Candidate((), 0.0, 0.0, -3.0, "")),
    ring_picture=Picture(np.arange(5), AZIMUTH, WAVE, HOLED),
    wall_picture=WallPicture(np.arange(5.0), AZIMUTH, WAVE, HOLED),
)  # fmt: skip

SHOWN = Shown(
    GeometryChange(
        np.full(12, 0.1), np.where(np.arange(12) == 3, np.nan, 0.2), 0.1,
        (DefectChange("pit", 133.0, 3.1, 0.8, 1.01, 0.03),),
    ),
    OnImage(4, np.zeros((60, 80), np.uint8), RING, RING, WAVE[0], 0.1 * WAVE[1]),
)  # fmt: skip


def test_a_named_effect_is_reported_with_its_confirmations_and_pictures(tmp_path):
    write_page(WHOLE, SHOWN, tmp_path)
    page = (tmp_path / "diagnosis.html").read_text()
    assert headline(WHOLE) == "Left out: laser tilt"
    assert page.count("data:image/png;base64,") == 5
    assert "does not agree" in page
    assert "<b>ghost" not in page
    assert "understated by 0.21 mm: the pit is 1.01 ± 0.03 mm, not 0.80 mm" in page
    assert "below 10⁻⁹" in page
    assert page.count("not known") == 2, "the noise floor, above and in the table"


def test_the_first_lines_give_the_size_with_its_sigma_and_the_consequence_for_the_pipe(tmp_path):
    write_page(WHOLE, Shown(), tmp_path)
    page = (tmp_path / "diagnosis.html").read_text()
    assert "angle by which the sheet leans forward: 0.600 ± 0.010 deg" in page
    assert "ring and texture differ by up to 0.100 mm" in page
    assert "after correction for the effects found, 0.001 mm remain" in page


def test_causes_of_a_class_with_the_same_sentence_are_listed_once(tmp_path):
    found = replace(WHOLE, verdict=Verdict.CLASS, effects=(TILT, TILT), identifiable=TILT.statement)
    write_page(found, Shown(), tmp_path)
    assert (tmp_path / "diagnosis.html").read_text().count(TILT.statement) == 1


def test_the_likeliest_cause_of_a_class_is_not_stated_as_a_fact(tmp_path):
    """A tilt with probability .4 among 24 causes was in bold like a fact."""
    perhaps = replace(TILT, probability=0.404)
    found = replace(WHOLE, verdict=Verdict.CLASS, effects=(perhaps,), identifiable=TILT.statement)
    write_page(found, Shown(), tmp_path)
    assert f"Perhaps (40 %): {TILT.statement}" in (tmp_path / "diagnosis.html").read_text()


def test_the_frame_shown_has_the_largest_residual_and_most_of_its_ring():
    frame = np.repeat([3, 5, 7, 9], [24, 22, 6, 24])
    residual = np.select([frame == 5, frame == 7], [0.2, 0.9], 0.01)
    residual[0] = 5.0  # a single bad bin
    none, usable = np.zeros(len(frame)), np.ones(len(frame), bool)
    seen = RingResidual("gauge", frame, none, none, none, np.zeros((len(frame), 2)), none, residual, usable)
    assert worst_frame(seen) == 5


def test_an_unmeasured_place_is_called_not_measured(tmp_path):
    found = replace(WHOLE, location=Location("profile", None, None))
    write_page(found, Shown(), tmp_path)
    assert (tmp_path / "diagnosis.html").read_text().count("not measured") == 4


@pytest.mark.parametrize("verdict", [v for v in Verdict if v is not Verdict.NAMED])
def test_every_other_verdict_has_its_page(tmp_path, verdict):
    bare = Diagnosis(recording="", gauge="gauge", verdict=verdict, global_p=float("nan"), members=("a", "b"))
    write_page(bare, Shown(), tmp_path)
    page = (tmp_path / "diagnosis.html").read_text()
    assert headline(bare) in page
    assert "nan" not in page


def test_every_size_of_a_slip_is_stated_in_words() -> None:
    numbers = {"slip_mm": Value(-3.3, 0.06), "time_s": Value(4.2, 0.02), "duration_s": Value(0.29, 0.02)}
    told = sizes(EffectFound("encoder_slip", 0.98, numbers, "", ""))
    assert told[-1] == "duration: 0.290 ± 0.020 s"
    assert not any("_" in words for words in told)
