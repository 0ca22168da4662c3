"""A side of the picture that darkens during a run, and is therefore in a part of the wall's photo as well."""

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from pipeline.instrument.probe import Lighting
from stages.twin.causes import causes
from stages.twin.cells import SECTORS, Cells, Fitted, Law, sector_azimuth_rad
from stages.twin.laws import lit_laws
from stages.twin.photo_course import hidden_failures, share_of_frames
from stages.twin.reference import WALL_COLUMNS
from stages.twin.scene import Ring
from stages.twin.seen_in_photo import beside_sectors
from stages.twin.steps import side_at_once

RING, RADIUS_MM = Ring((400.0, 300.0), 200.0, 50.0, 23.0), 50.0
FRAMES, STEP_MM = 14, 5.0
AHEAD_MM = np.arange(6.0, 70.0, 2.5)
"""Distances of the wall ahead of the camera that frames show."""
AWAY = np.arctan2(RADIUS_MM, AHEAD_MM) / np.arctan2(RADIUS_MM, RING.ahead_mm)


def _samples():
    """Blocks of frames 5 mm apart, each of which shows rings of wall; brighter near the sheet."""
    frame, place = np.indices((FRAMES, len(AHEAD_MM))).reshape(2, -1)
    along = ((AHEAD_MM[place] + STEP_MM * frame) / 2.5).astype(int)
    log_level = 4.0 - 0.02 * np.abs(AHEAD_MM[place] - RING.ahead_mm)
    return SimpleNamespace(
        frame=frame, number=8 * np.arange(FRAMES), away=AWAY[place], log_level=log_level,
        weight=np.ones(len(frame)), orders={"wall": along * WALL_COLUMNS},
    )  # fmt: skip


def _in_photo(course):
    """Mean over the wall in each frame of the photo's mean of a course, made from frames 1 mm apart."""
    place_mm = np.arange(0.0, 200.0, 1.0)
    camera_mm = np.arange(0.0, STEP_MM * FRAMES, 1.0)
    from_sheet = place_mm[:, None] - camera_mm - RING.ahead_mm
    made = np.maximum(1 - (from_sheet / (0.5 * RADIUS_MM)) ** 2, 0) ** 2
    photo = made @ course(camera_mm / STEP_MM) / np.maximum(made.sum(1), 1e-9)
    seen = [AHEAD_MM + STEP_MM * k for k in range(FRAMES)]
    known = made.sum(1) > 0
    return np.array([np.interp(at[at < place_mm[known].max()], place_mm, photo).mean() for at in seen])


def _cells(lost, first, seed=0):
    """Cells whose photo was made from frames before and after a side darkened."""
    random, pixels, level = np.random.default_rng(seed), 500.0, 20.0
    side = np.log1p(-lost * np.maximum(np.cos(sector_azimuth_rad() - 0.1), 0) ** 2)

    def course(frame):
        return (frame >= first).astype(float)

    beyond = course(np.arange(FRAMES)) - _in_photo(course)
    ratio = np.exp(beyond[:, None] * side + 0.01 * random.standard_normal((FRAMES, SECTORS)))
    own = np.full((FRAMES, SECTORS), pixels * level**2)
    square = pixels * (1 + (ratio * level) ** 2)
    full = np.full_like(own, pixels)
    return Cells(8 * np.arange(FRAMES), square, ratio * own, own, full, level * full)


@pytest.mark.parametrize("first", [5, 7, 9])
@pytest.mark.parametrize("lost", [0.5, 0.9])
def test_a_side_that_darkens_is_told_though_the_photo_holds_it(lost, first):
    """Nothing was told: the photo's part of it rises and falls about the step, which no law contained."""
    (side,) = causes(_cells(lost, first), None, Lighting(), RING, _samples())[0]
    assert (side.name, side.fixed_to) == ("", "time")
    assert side.place[0].value == 8 * first - 4
    assert side.place[1].value == pytest.approx(np.degrees(0.1), abs=12)
    assert side.parameters[0].value == pytest.approx(lost, abs=0.12)


def test_nothing_is_told_beside_a_photo_where_nothing_darkens():
    assert all(
        causes(_cells(0.0, 7, seed), None, Lighting(), RING, _samples()) == ((), ()) for seed in range(8)
    )


@pytest.mark.parametrize(("slow", "is_step"), [(0.0, True), (0.4, True), (1.0, False)])
def test_a_side_darkens_only_if_it_does_so_at_once(slow, is_step):
    """Beside a photo dark on one side, a probe that rolled by 6° saw a flank darken slowly by 19 %."""
    frame, flank = np.arange(FRAMES)[:, None], np.exp(-0.5 * ((sector_azimuth_rad() + 0.5) / 0.35) ** 2)
    step, ramp = (frame >= 4) - 0.5, np.clip(frame / 8, 0, 1) - 0.5
    law = Law("lamp_sector", -0.2 * (step * flank)[None], np.array([[-0.5, 4, 0.5, 40]]))
    side = Fitted(law, 0, 1.0, 0.05, 1e-4, np.zeros(FRAMES), 2.0, 1.0)
    cells = _cells(0.0, 7)
    seen = np.exp(-0.2 * ((1 - slow) * step + slow * ramp) * flank + 0.3 * (frame == 4))
    assert side_at_once(side, 4, replace(cells, cross=cells.cross * seen)) == is_step


def test_the_photo_in_a_frame_is_made_from_the_frames_about_it():
    share = share_of_frames(_samples(), RING, 8 * np.arange(FRAMES))
    assert share.sum(1) == pytest.approx(1.0)
    middle = share @ np.arange(FRAMES)
    assert np.all(np.diff(middle) > 0)
    assert share_of_frames(None, RING, np.arange(3)).any() == 0


@pytest.mark.parametrize(("step_mm", "tried"), [(5.0, 2), (60.0, 1)])
def test_no_law_of_the_photo_is_tried_between_frames_far_apart(step_mm, tried, monkeypatch):
    """A loss of a half between frames 60 mm apart was told as one of 96 %, with a σ of 3 %."""
    cells = _cells(0.0, 7)
    monkeypatch.setattr("tests.unit.test_twin_photo_course.STEP_MM", step_mm)
    share = share_of_frames(_samples(), RING, cells.frame)
    with_it, without = (lit_laws(cells, Lighting(), RING, a)[1] for a in (share, np.zeros_like(share)))
    assert [len(a.places) / len(b.places) for a, b in zip(with_it, without, strict=True)] == [1, tried, tried]


@pytest.mark.parametrize(("step_mm", "sentences"), [(5.0, 0), (20.0, 1), (60.0, 1)])
def test_where_a_failing_led_may_be_missed_it_is_said(step_mm, sentences, monkeypatch):
    """Between frames far apart nothing was told of it."""
    monkeypatch.setattr("tests.unit.test_twin_photo_course.STEP_MM", step_mm)
    said = hidden_failures(_samples(), RING)
    assert len(said) == sentences
    assert all("11 of 11 neighbouring pairs" in s and "may be missed" in s for s in said)
    assert hidden_failures(None, RING) == ()


def test_the_photo_of_a_long_pipe_takes_little_memory():
    """Of 30 m of pipe it took 4.5 GB: every cell of the wall was kept for every frame."""
    samples = _samples()
    samples.orders["wall"][-1] = 1_000_000
    tracemalloc.start()
    share_of_frames(samples, RING, 8 * np.arange(FRAMES))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6


def _unnamed(at_deg):
    turn = np.radians(at_deg)
    look = Look(8, 400 + 150 * np.cos(turn), 300 + 150 * np.sin(turn), 60.0)
    return Mismatch("", "intensity", "image", (), (), 0.0, 2.0, 1.0, "It is 263 % brighter.", look)


@pytest.mark.parametrize(("at_deg", "left"), [(-26.0, True), (80.0, True), (150.0, False)])
def test_no_place_is_told_where_the_photo_was_made_before_the_side_darkened(at_deg, left):
    """A place 263 % brighter was told of a recording whose LEDs lost 90 % of their light on that side."""
    at = (NamedFigure("frame_from", 51.0, 2.0), NamedFigure("azimuth_deg", 0.0, 7.0))
    side = Mismatch("", "intensity", "time", at, (), 0.0, 2.0, 1.0, "Darker.")
    kept, withdrawn = beside_sectors((_unnamed(at_deg),), (side,), RING)
    assert (len(kept), len(withdrawn)) == (not left, left)
    wandering = replace(_unnamed(at_deg), fixed_to="time", statement="Spots, each time elsewhere.")
    assert beside_sectors((wandering,), (side,), RING) == ((wandering,), ())
    exposure = (NamedFigure("exposure", 0.05, 0.01),)
    for name in ("flicker or led_dead", ""):
        flickers = replace(side, name=name, parameters=exposure)
        assert beside_sectors((_unnamed(at_deg),), (flickers,), RING) == ((_unnamed(at_deg),), ())


@pytest.mark.parametrize(("distance_mm", "left"), [(5.0, False), (60.0, True), (160.0, False)])
def test_wall_far_from_where_a_side_darkens_is_told(distance_mm, left):
    """Wall that only frames long after the change show, and that they photographed, was withdrawn."""
    at = (NamedFigure("frame_from", 60.0, 2.0), NamedFigure("azimuth_deg", 0.0, 7.0))
    side = Mismatch("", "intensity", "time", at, (), 0.0, 2.0, 1.0, "Darker.")
    place = (NamedFigure("distance_mm", distance_mm, 1.0),)
    wall = replace(_unnamed(0.0), fixed_to="wall", place=place)
    samples = _samples()
    samples.first_mm, samples.cell_mm = 0.0, 2.5
    samples.along = samples.orders["wall"] // WALL_COLUMNS
    assert len(beside_sectors((wall,), (side,), RING, samples)[1]) == left
