"""The report opens offline, lists what was not used, and lets no text become markup."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.artefacts.motion import MotionEvent
from pipeline.export import report
from pipeline.export.report import page_of, write_report
from pipeline.export.report.tables import RunSummary, tables
from pipeline.geometry.axis import PipeAxis
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.machine.outcome import Number, StageOutcome, State
from stages.defects import DefectParameters, find_defects
from stages.overlays import OverlayParameters, draw_overlays
from stages.sections import SectionParameters, measure_sections
from tests.quiet import quiet_context
from tests.synthetic_wall import DrawnDefect, bare_recording, grey_texture, relief, smooth_noise, wall_of

HOSTILE = '<script>alert("x")</script>&"\'>'
PROBE = Probe(
    KannalaBrandt((1600, 1200), (360.0, 360.0), (799.5, 599.5)), LaserSheet(22.0), 1e-6 * np.eye(20)
)
FRAMES = np.arange(6)


def a_trajectory():
    axis = PipeAxis(np.array([-9.0, 99.0]), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)))
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 2, 3] = np.arange(5)
    event = MotionEvent("slip", 2, 3, 1.5, "mm", HOSTILE)
    return Trajectory(
        FRAMES[:5], FRAMES[:5] / 30, poses, np.tile(1e-4 * np.eye(6), (5, 1, 1)), axis, 30.0, 1.0, 0.001,
        0.0005, (event,),
    )  # fmt: skip


def rings():
    validity = np.zeros((3, 8), np.uint8)
    validity[0] = RingValidity.FRAME_REJECTED
    validity[1, :2] = RingValidity.GLINT
    empty = np.zeros(validity.shape, np.float32)
    return RingSamples(
        np.array([0, 2, 4]), np.linspace(-3, 3, 8), np.zeros(2), empty, empty, empty, empty, validity
    )


@pytest.fixture(scope="module")
def summary():
    rng = np.random.default_rng(0)
    distance, azimuth = np.arange(0, 120, 0.5), -np.pi + np.arange(360) * np.pi / 180
    pit = DrawnDefect("pit", 60.0, -np.pi / 2, 8.0, 8.0, 1.0)
    shape = (len(distance), 360)
    radius = 30 + relief(pit, distance, azimuth, 30.0, rng) + smooth_noise(rng, shape, 0.03, 2.0)
    wall = wall_of(distance, azimuth, radius)
    context, texture = quiet_context(), grey_texture(wall)
    recording = replace(bare_recording(60.0, 4.0, name=HOSTILE), warnings=(HOSTILE,))
    return RunSummary(
        recording, PROBE, "",
        rings=rings(),
        trajectory=a_trajectory(),
        wall=wall,
        texture=texture,
        overlays=draw_overlays(recording, wall, OverlayParameters(), context),
        sections=measure_sections(recording, wall, SectionParameters(), context),
        defects=find_defects(recording, wall, texture, DefectParameters(), context),
        stages=(
            StageOutcome(
                "rings", "1", "ab" * 32, State.COMPLETED, 1.5,
                (Number("rejected: " + HOSTILE, 12, "samples"),), HOSTILE,
            ),
        ),
        versions=(("boresight", "0.1.0"),),
        inputs=((HOSTILE, "cd" * 32),),
    )  # fmt: skip


def written(summary, folder):
    write_report(summary, folder)
    return (folder / "report.html").read_text(encoding="utf-8")


class Outside(HTMLParser):
    """Collects tags, and every address outside the file."""

    def __init__(self):
        super().__init__()
        self.tags, self.addresses = set(), []

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        for name, value in attrs:
            if name in ("src", "href", "data", "srcset", "action") and not value.startswith("data:image/"):
                self.addresses.append(value)


def test_opens_offline_and_stays_small(summary, tmp_path):
    text = written(summary, tmp_path)
    page = Outside()
    page.feed(text)
    assert page.addresses == []
    assert not page.tags & {"script", "link", "iframe", "object"}
    assert not re.search(r"url\(|@import|https?://", text)
    assert len(text) < 8e6
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_no_text_becomes_markup(summary, tmp_path):
    text = written(summary, tmp_path)
    assert "<script" not in text
    assert text.count("&lt;script&gt;") >= 6


def test_the_pit_is_shown_with_pictures_clock_position_and_wall_loss(summary):
    (finding,) = page_of(summary).findings
    assert finding.kind == "pit"
    assert finding.probability == "above 90 %"
    assert re.match(r"11:\d\d–12:\d\d$", finding.clock)
    assert re.match(r"[56]\d\.\d mm \(\d\d\.\d–\d\d\.\d mm\)$", finding.distance), "peak and extent"
    assert re.match(r"\d\.\d+ ± \d\.\d+ mm deep$", finding.depth)
    loss = re.fullmatch(r"(\d+\.\d+) ± (\d\.\d+) %", finding.wall_loss)
    assert loss is not None
    assert 22 <= float(loss[1]) <= 29
    assert finding.photo.startswith("data:image/jpeg;base64,")
    assert finding.deviation.startswith("data:image/jpeg;base64,")


def test_a_probability_is_stated_no_more_precisely_than_it_was_validated(summary):
    (pit,) = summary.defects.items
    for stated, told in ((0.99, "above 90 %"), (0.64, "about 64 %"), (np.nan, "not known")):
        defects = replace(summary.defects, items=(replace(pit, probability=stated),))
        (finding,) = page_of(replace(summary, defects=defects)).findings
        assert finding.probability == told


def test_the_mark_is_in_the_middle_of_the_flat_view(summary):
    (mark,) = page_of(summary).flats[0].strips[0].marks
    assert mark.left + mark.width / 2 == pytest.approx(50, abs=2)
    assert mark.top + mark.height / 2 == pytest.approx(50, abs=2)


def test_the_wall_stays_visible_behind_the_numbers_of_very_many_findings(summary, tmp_path):
    few = written(summary, tmp_path)
    one = summary.defects.items[0]
    many = replace(summary.defects, items=tuple(replace(one, id=k + 1) for k in range(60)))
    crowd = written(replace(summary, defects=many), tmp_path)
    assert '<div class="strip">' in few
    assert '<div class="strip crowded">' in crowd
    assert re.search(r"\.crowded \.mark b \{ display: none", crowd)


def test_warnings_of_stages_come_first_and_as_text(summary, tmp_path):
    motion = StageOutcome("motion", "1", "", State.COMPLETED, 1.0, (Number("warning", f"36 σ {HOSTILE}"),))
    warned = replace(summary, stages=(*summary.stages, motion))
    text = written(warned, tmp_path)
    assert text.index("motion: 36 σ &lt;script&gt;") < text.index("Ring samples")
    assert text.count("36 σ") == 1
    assert "Look at this first" not in written(
        replace(summary, recording=replace(summary.recording, warnings=())), tmp_path
    )


def test_every_frame_and_sample_is_accounted_for(summary):
    told = {t.caption: t for t in tables(summary)}
    samples = {r[0]: int(r[1]) for r in told["Ring samples"].rows}
    assert samples.pop("all") == sum(samples.values()) == 24
    assert samples["glint"] == 2
    frames = {r[0]: r[1:] for r in told["Frames"].rows}
    assert frames["lit by both"][0] == frames["in the recording"][0] == "3"
    assert frames["laser frames of which no sample was used"] == ("1", "0")
    assert told["Not used, by stage and reason"].rows[0][2] == "12 samples"


def test_the_report_says_that_the_instrument_was_only_stated(summary):
    assert any("not calibrated" in c.warning for c in page_of(summary).cards)
    calibrated = replace(summary, probe=replace(PROBE, calibrated_from="gauge 7"))
    assert not any(c.warning for c in page_of(calibrated).cards)


def test_an_incomplete_run_still_gets_its_report(summary, tmp_path):
    stopped = StageOutcome("rings", "1", "", State.UNUSABLE, 0.1, problem="no ring in any frame")
    text = written(RunSummary(summary.recording, PROBE, "", stages=(stopped,)), tmp_path)
    assert "The run stopped at the stage rings: no ring in any frame" in text


def test_the_same_run_gives_the_same_bytes(summary, tmp_path):
    assert written(summary, tmp_path) == written(summary, tmp_path)


def luminance(colour):
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


def test_texts_have_the_contrast_of_wcag_aa_in_light_and_dark():
    css = Path(report.__file__).with_name("report.css").read_text()
    themes = re.findall(r":root \{([^}]*--warn-ink[^}]*)\}", css)
    assert len(themes) == 3
    pairs = (
        ("ink", "ground"),
        ("ink", "panel"),
        ("soft", "ground"),
        ("soft", "panel"),
        ("warn-ink", "warn-ground"),
    )
    for theme in themes:
        colours = dict(re.findall(r"--([\w-]+): (#\w+)", theme))
        colours = {k: v if len(v) == 7 else "#" + "".join(2 * c for c in v[1:]) for k, v in colours.items()}
        for ink, ground in pairs:
            high, low = sorted((luminance(colours[ink]), luminance(colours[ground])), reverse=True)
            assert (high + 0.05) / (low + 0.05) >= 4.5, (ink, ground)
