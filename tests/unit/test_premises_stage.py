"""Lights and times that do not fit the pictures are detected and corrected; right ones are not changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import UnusableError
from pipeline.recording.base import FrameTable
from tests.premises_run import COUNT, checked
from tests.ring_images import MemorySource
from tests.spoiled_recordings import (
    SPOILERS,
    lost,
    swapped_from,
    wrong_at_random,
)


def test_a_right_recording_is_not_changed(good, run):
    found, told = checked(good, run.probe)
    assert told == []
    assert found.encoder_factor == 1.0
    assert (found.relabelled, found.retimed) == (0, 0)
    np.testing.assert_array_equal(found.time_s, good.frames.time_s)


@pytest.mark.parametrize(
    "name", [n for n in SPOILERS if n not in ("as it is", "2 neighbours lost, not shifted")]
)
@pytest.mark.parametrize("seed", [1, 2])
def test_lights_and_times_are_corrected(name, seed, good, run):
    spoiled = SPOILERS[name](good, np.random.default_rng(seed))
    found, told = checked(spoiled.recording, run.probe)
    assert spoiled.wrong(found) == (0, 0)
    assert told
    assert all("What to do" in t for t in told)


def test_the_frames_at_which_the_recording_was_cut_are_passed_on(good, run, monkeypatch):
    assert checked(good, run.probe)[0].cut == ()
    monkeypatch.setattr("stages.premises.cuts", lambda *_: np.array([31]))
    found, told = checked(good, run.probe)
    assert found.cut == (30,), "the picture of the line before it may lie behind the cut as well"
    assert "frame 31 does not continue the wall of frame 29" in told[0]


def test_the_spoiled_recordings_are_wrong(good):
    """Without correction, the errors that the tests count are there."""
    from pipeline.recording.checks import CheckedFrames

    for spoil in (lost(1), swapped_from, wrong_at_random):
        spoiled = spoil(good, np.random.default_rng(1))
        frames = spoiled.recording.frames
        believed = CheckedFrames(frames.frame, frames.time_s, frames.illumination)
        assert max(spoiled.wrong(believed)) > 4


def test_a_loss_that_keeps_the_rhythm_is_detected_by_the_motion(good, run):
    spoiled = lost(2, together=True)(good, np.random.default_rng(1))
    found, told = checked(spoiled.recording, run.probe)
    lights, times = spoiled.wrong(found)
    assert lights == 0
    assert times <= 1  # before or after the laser picture between the two lit ones
    assert "2 pictures lost" in told[0]


def test_the_frame_after_the_loss_is_named(good, run):
    kept = np.delete(np.arange(COUNT), 31)
    spoiled = lost(1)(good, _Chosen(31))
    np.testing.assert_array_equal(spoiled.recording.source.kept, kept)
    _, told = checked(spoiled.recording, run.probe)
    assert "before frame 31 (1)" in told[0]


def test_a_repeated_picture_is_reported_once(good, run):
    """It was reported as a harmless repetition, and again as a hang during which wall was passed."""
    order = [*range(30), 29, *range(30, COUNT)]
    lights = np.array(["laser", "led"])[np.arange(len(order)) % 2]
    found, told = checked(rearranged(good, order, lights), run.probe)
    assert len(found.frame) == COUNT
    assert len([t for t in told if "frame 30" in t]) == 1
    assert "they repeat the picture before: frame 30" in told[0]
    assert f"the {COUNT - 30} frames after them now have the times of earlier rows" in told[0]


class _Chosen:
    """Chooses one frame instead of a random one."""

    def __init__(self, frame):
        self.frame = frame

    def choice(self, _, size=None, replace=True):
        return self.frame if size is None else np.array([self.frame])


def test_without_repair_the_run_stops_and_names_the_frame(good, run):
    spoiled = swapped_from(good, np.random.default_rng(1))
    first = int(np.flatnonzero(spoiled.recording.frames.illumination != good.frames.illumination)[0])
    with pytest.raises(UnusableError, match=f"from frame {first} on"):
        checked(spoiled.recording, run.probe, mend=False)


def relabelled(recording, lights):
    table = FrameTable(recording.frames.frame, recording.frames.time_s, np.array(lights, "U8"))
    return replace(recording, frames=table, listed=None)


def rearranged(good, order, lights):
    """Return a recording of some pictures (numbers of ``good``), as many as the table has rows."""
    images = {k: good.source.images[n] for k, n in enumerate(order)}
    table = FrameTable(np.arange(len(order)), np.arange(len(order)) / 30, np.array(lights, "U8"))
    source = MemorySource(images, good.source.image_size)
    return replace(good, frames=table, listed=None, source=source, encoder=None)


def test_a_recording_with_one_light_is_not_changed(good, run):
    for light, first in (("laser", 0), ("led", 1), ("both", 1)):
        order = np.arange(first, COUNT, 2)
        found, told = checked(rearranged(good, order, [light] * len(order)), run.probe)
        assert (found.relabelled, found.retimed, told) == (0, 0, [])


def test_an_irregular_order_that_the_table_states_is_not_changed(good, run):
    lasers, leds = iter(range(0, COUNT, 2)), iter(range(1, COUNT, 2))
    lights = ["led" if k % 3 == 2 else "laser" for k in range(30)] + ["led", "led", "laser", "led"] * 3
    order = [next(leds if light == "led" else lasers) for light in lights]
    found, told = checked(rearranged(good, order, lights), run.probe)
    assert (found.relabelled, found.retimed, told) == (0, 0, [])


def test_a_table_of_one_light_is_refused_where_two_alternate(good, run):
    with pytest.raises(UnusableError, match=r"frames\.csv says laser of every frame, but 30 pictures show"):
        checked(relabelled(good, ["laser"] * COUNT), run.probe)


def test_a_table_of_two_lights_is_refused_where_all_pictures_look_the_same(good, run):
    order = [2 * (k // 2) for k in range(COUNT)]
    with pytest.raises(UnusableError, match="all pictures look the same"):
        checked(rearranged(good, order, ["laser", "led"] * (COUNT // 2)), run.probe)


def test_pictures_of_a_covered_lens_keep_their_stated_light_and_are_reported(good, run):
    dark = np.random.default_rng(0).integers(2, 6, good.source.images[0].shape).astype(np.uint8)
    images = {k: dark if k < 6 else image for k, image in good.source.images.items()}
    covered = replace(good, source=MemorySource(images, good.source.image_size))
    found, told = checked(covered, run.probe)
    assert (found.relabelled, found.retimed) == (0, 0)
    assert any("neither a laser line in the dark" in t and "frame 0, 1, 2, 3, 4, 5" in t for t in told)
