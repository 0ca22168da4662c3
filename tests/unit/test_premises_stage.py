"""Tables that do not fit the pictures are found out and mended; right ones are left alone."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.errors import UnusableError
from pipeline.recording.base import Encoder, FrameTable, PipeFacts
from stages.premises import PremisesParameters, check_premises
from stages.premises.light import Steps, rows_by_motion
from tests.drawn_run import BASELINE, RADIUS, drawn_run
from tests.quiet import quiet_context
from tests.ring_images import MemorySource
from tests.spoiled_recordings import (
    SPOILERS,
    KeptFrames,
    Spoiled,
    lost,
    repeated,
    swapped_from,
    wrong_at_random,
)

COUNT, STEP_MM = 60, 1.0


@pytest.fixture(scope="module")
def run():
    return drawn_run(STEP_MM * np.arange(COUNT), np.zeros(COUNT))


@pytest.fixture(scope="module")
def good(run):
    """A drawn recording, laser and led by turns, with a closed line in the dark in its laser frames."""
    lines = {int(f): ring_image(run.probe, seed=int(f)) for f in run.rings.frame}
    source = MemorySource({**run.recording.source.images, **lines}, run.probe.camera.image_size)
    return replace(run.recording, source=source)


def ring_image(probe, seed=0):
    width, height = probe.camera.image_size
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    seen = probe.camera.project(np.array([RADIUS, 0.0, BASELINE])).uv[0] - probe.camera.centre_px[0]
    off = np.hypot(u - probe.camera.centre_px[0], v - probe.camera.centre_px[1]) - seen
    noise = np.random.default_rng(seed).standard_normal(off.shape)
    return np.clip(np.rint(4 + 180 * np.exp(-0.5 * (off / 1.2) ** 2) + noise), 0, 255).astype(np.uint8)


def checked(recording, probe, **parameters):
    told = []
    context = replace(quiet_context(), warn=told.append)
    return check_premises(recording, probe, PremisesParameters(**parameters), context), told


def test_a_right_recording_is_left_alone(good, run):
    found, told = checked(good, run.probe)
    assert told == []
    assert found.encoder_factor == 1.0
    assert (found.relabelled, found.retimed) == (0, 0)
    np.testing.assert_array_equal(found.time_s, good.frames.time_s)


@pytest.mark.parametrize(
    "name", [n for n in SPOILERS if n not in ("as it is", "2 neighbours lost, not shifted")]
)
@pytest.mark.parametrize("seed", [1, 2])
def test_lights_and_times_are_mended(name, seed, good, run):
    spoiled = SPOILERS[name](good, np.random.default_rng(seed))
    found, told = checked(spoiled.recording, run.probe)
    assert spoiled.wrong(found) == (0, 0)
    assert told
    assert all("What to do" in t for t in told)


def test_the_spoilings_spoil(good):
    """Without mending, what is counted as wrong is there."""
    from pipeline.recording.checks import CheckedFrames

    for spoil in (lost(1), swapped_from, wrong_at_random):
        spoiled = spoil(good, np.random.default_rng(1))
        frames = spoiled.recording.frames
        believed = CheckedFrames(frames.frame, frames.time_s, frames.illumination)
        assert max(spoiled.wrong(believed)) > 4


def test_a_loss_that_leaves_the_rhythm_whole_is_seen_by_the_motion(good, run):
    spoiled = lost(2, together=True)(good, np.random.default_rng(1))
    found, told = checked(spoiled.recording, run.probe)
    lights, times = spoiled.wrong(found)
    assert lights == 0
    assert times <= 1  # before or after the laser picture between the two of the wall
    assert "2 pictures were lost" in told[0]


def test_the_frame_from_which_they_were_lost_is_named(good, run):
    kept = np.delete(np.arange(COUNT), 31)
    spoiled = lost(1)(good, _Chosen(31))
    np.testing.assert_array_equal(spoiled.recording.source.kept, kept)
    _, told = checked(spoiled.recording, run.probe)
    assert "before frame 31 (1)" in told[0]


class _Chosen:
    """Chooses one frame in place of a random one."""

    def __init__(self, frame):
        self.frame = frame

    def choice(self, _, size=None, replace=True):
        return self.frame if size is None else np.array([self.frame])


def test_what_is_not_to_be_mended_stops_the_run_with_the_frame(good, run):
    spoiled = swapped_from(good, np.random.default_rng(1))
    first = int(np.flatnonzero(spoiled.recording.frames.illumination != good.frames.illumination)[0])
    with pytest.raises(UnusableError, match=f"from frame {first} on"):
        checked(spoiled.recording, run.probe, mend=False)


def relabelled(recording, lights):
    table = FrameTable(recording.frames.frame, recording.frames.time_s, np.array(lights, "U8"))
    return replace(recording, frames=table, listed=None)


def rearranged(good, order, lights):
    """Return a recording of some pictures (numbers of ``good``), as many as there are rows in the table."""
    images = {k: good.source.images[n] for k, n in enumerate(order)}
    table = FrameTable(np.arange(len(order)), np.arange(len(order)) / 30, np.array(lights, "U8"))
    source = MemorySource(images, good.source.image_size)
    return replace(good, frames=table, listed=None, source=source, encoder=None)


def test_one_light_is_left_alone(good, run):
    for light, first in (("laser", 0), ("led", 1), ("both", 1)):
        order = np.arange(first, COUNT, 2)
        found, told = checked(rearranged(good, order, [light] * len(order)), run.probe)
        assert (found.relabelled, found.retimed, told) == (0, 0, [])


def test_an_irregular_order_that_the_table_knows_is_left_alone(good, run):
    lasers, leds = iter(range(0, COUNT, 2)), iter(range(1, COUNT, 2))
    lights = ["led" if k % 3 == 2 else "laser" for k in range(30)] + ["led", "led", "laser", "led"] * 3
    order = [next(leds if light == "led" else lasers) for light in lights]
    found, told = checked(rearranged(good, order, lights), run.probe)
    assert (found.relabelled, found.retimed, told) == (0, 0, [])


def test_a_table_of_one_light_is_refused_where_two_alternate(good, run):
    with pytest.raises(UnusableError, match=r"frames\.csv says laser of every frame, but 30 pictures show"):
        checked(relabelled(good, ["laser"] * COUNT), run.probe)


def test_a_table_of_two_lights_is_refused_where_all_look_alike(good, run):
    order = [2 * (k // 2) for k in range(COUNT)]
    with pytest.raises(UnusableError, match="all pictures look alike"):
        checked(rearranged(good, order, ["laser", "led"] * (COUNT // 2)), run.probe)


def test_covered_lens_counts_as_stated_and_is_told(good, run):
    dark = np.random.default_rng(0).integers(2, 6, good.source.images[0].shape).astype(np.uint8)
    images = {k: dark if k < 6 else image for k, image in good.source.images.items()}
    covered = replace(good, source=MemorySource(images, good.source.image_size))
    found, told = checked(covered, run.probe)
    assert (found.relabelled, found.retimed) == (0, 0)
    assert any("neither a closed laser line" in t and "frame 0, 1, 2, 3, 4, 5" in t for t in told)


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1 / 25.4, "in inch"),
        (1 / 1000, "in m "),
        (-1.0, "its sign reversed"),
        (-0.1, "in cm in place of mm and"),
    ],
)
def test_the_encoder_is_brought_to_mm_and_to_the_sense_of_the_motion(factor, message, good, run):
    encoder = Encoder(good.encoder.time_s, good.encoder.distance_mm * factor)
    found, told = checked(replace(good, encoder=encoder), run.probe)
    assert found.encoder_factor == pytest.approx(1 / factor)
    assert message in told[0]
    repaired = found.applied_to(replace(good, encoder=encoder)).encoder
    np.testing.assert_allclose(repaired.distance_mm, good.encoder.distance_mm)


@pytest.mark.parametrize(
    ("diameter_mm", "message"), [(2 * RADIUS / 25.4, "stated in inch"), (RADIUS, "the radius were stated")]
)
def test_a_diameter_that_the_ring_contradicts_ends_the_run(diameter_mm, message, good, run):
    with pytest.raises(UnusableError, match=message):
        checked(replace(good, pipe=PipeFacts(diameter_mm)), run.probe)


def test_a_baseline_in_metres_ends_the_run(good, run):
    laser = replace(run.probe.laser, baseline_mm=BASELINE / 1000)
    with pytest.raises(UnusableError, match="baseline were stated in m"):
        checked(good, replace(run.probe, laser=laser))


def test_another_diameter_and_another_clock_are_told(good, run):
    table = replace(good.frames, time_s=good.frames.time_s * 1000)
    _, told = checked(replace(good, frames=table, pipe=PipeFacts(2.3 * RADIUS)), run.probe)
    assert any("diameter is 100" in t for t in told)
    assert any("check the unit (s) of time_s" in t for t in told)


def test_repeated_pictures_are_left_out(good, run):
    spoiled: Spoiled = repeated(good, np.random.default_rng(1))
    found, told = checked(spoiled.recording, run.probe)
    assert len(found.frame) == len(spoiled.recording.frames.frame) - 1
    assert np.all(np.diff(found.time_s) > 0)
    assert any("repeat the picture before" in t for t in told)


@pytest.mark.parametrize("first", [21, 22], ids=["led", "laser"])
@pytest.mark.parametrize("count", [1, 6, 15])
def test_pictures_of_a_recorder_that_hung_are_left_out_and_all_times_stay(first, count, good, run):
    frame = np.arange(COUNT)
    hung = (frame > first) & (frame <= first + count)
    spoiled = replace(good, source=KeptFrames(good.source, np.where(hung, first, frame)))
    found, told = checked(spoiled, run.probe)
    assert found.frame.tolist() == frame[~hung].tolist()
    np.testing.assert_allclose(found.time_s, good.frames.time_s[~hung])
    assert np.array_equal(found.illumination, good.frames.illumination[~hung])
    assert len(told) == 1
    assert f"{count} pictures show the picture before once more" in told[0]


@pytest.mark.parametrize("repeats", [slice(19, None, 20), slice(18, None, 20), slice(9, None, 7)])
def test_pictures_that_repeat_the_last_one_of_their_light_are_left_out(repeats, good, run):
    frame, again = np.arange(COUNT), np.zeros(COUNT, bool)
    again[repeats] = True
    shown = {k: good.source.images[k - 2 if again[k] else k] for k in frame}
    spoiled = replace(good, source=MemorySource(shown, run.probe.camera.image_size))
    found, told = checked(spoiled, run.probe)
    assert found.frame.tolist() == frame[~again].tolist()
    np.testing.assert_allclose(found.time_s, good.frames.time_s[~again])
    assert len(told) == 1
    assert f"{again.sum()} pictures show" in told[0]


def test_pictures_of_a_probe_that_stops_are_no_repeats():
    z = np.concatenate([np.arange(20), np.full(20, 20), 20 + np.arange(20)])
    halting = drawn_run(STEP_MM * z, 0.0 * z)
    lines = {int(f): ring_image(halting.probe, seed=int(f)) for f in halting.rings.frame}
    source = MemorySource({**halting.recording.source.images, **lines}, halting.probe.camera.image_size)
    found, _ = checked(replace(halting.recording, source=source), halting.probe)
    assert len(found.frame) == COUNT


@pytest.mark.parametrize("replaced", [False, True])
def test_a_repeated_picture_in_one_light_is_left_out(good, run, replaced):
    lit = np.flatnonzero(good.frames.illumination == "led")
    kept = np.insert(lit, 12, lit[11]) if not replaced else np.where(np.arange(len(lit)) == 12, lit[11], lit)
    time_s = np.arange(len(kept)) / 15
    table = FrameTable(np.arange(len(kept)), time_s, np.full(len(kept), "both"))
    found, told = checked(
        replace(good, frames=table, source=KeptFrames(good.source, kept), encoder=None), run.probe
    )
    assert 12 not in found.frame
    assert len(found.frame) == len(kept) - 1
    behind = time_s[13:] if replaced else time_s[12:-1]
    np.testing.assert_allclose(found.time_s[12:], behind)
    assert any("repeat the picture before" in t for t in told)


def scratches(size):
    """Nine thin bright strokes on the window, as bright as the lamps make them."""
    drawn, random = np.zeros(size[::-1], np.uint8), np.random.default_rng(2)
    for _ in range(9):
        at, way = random.uniform(0.2, 0.8, 2) * size, random.uniform(-60, 60, 2)
        cv2.line(drawn, at.astype(int).tolist(), (at + way).astype(int).tolist(), 240, 3, cv2.LINE_AA)
    return drawn


def test_scratches_on_the_window_are_not_taken_for_the_wall(good, run, monkeypatch):
    """A wrong unit of the encoder is seen by how the wall moves; scratches stand still."""
    size, light = run.probe.camera.image_size, good.frames.illumination
    by_light = {"led": scratches(size), "laser": scratches(size) // 20}
    images = {n: cv2.add(image, by_light[light[n]]) for n, image in good.source.images.items()}
    encoder = Encoder(good.encoder.time_s, good.encoder.distance_mm / 25.4)
    scratched = replace(good, source=MemorySource(images, size), encoder=encoder)
    found, told = checked(scratched, run.probe)
    assert "scratches" in told[0]
    assert found.encoder_factor == 25.4
    assert found.applied_to(scratched).stays is not None
    monkeypatch.setattr("stages.premises.places_that_stay", lambda *parts: None)
    assert checked(scratched, run.probe)[0].encoder_factor == 1, "the control: scratches are followed"


def test_a_speed_that_varies_over_pictures_left_out_is_no_loss():
    """After a camera hung for a second, 6 pictures "were lost": the probe had gone 20 % faster meanwhile."""
    frame = np.arange(0, 120, 2)
    there = (frame < 60) | (frame >= 90)
    place = np.cumsum(np.where(there, 0.02 + 0.001 * np.sin(frame / 3), 0.024))
    seen, way = frame[there], place[there]
    steps = Steps(seen[:-1], seen[1:], np.diff(way))
    table = FrameTable(np.arange(120), np.arange(120) / 30, np.full(120, "led"))
    encoder = Encoder(table.time_s, 10.0 * table.time_s)
    row = rows_by_motion(np.arange(120), steps, 2, table, encoder)
    np.testing.assert_array_equal(row, np.arange(120))


@pytest.mark.parametrize("stood", [False, True])
def test_a_jump_of_the_clock_is_taken_out_and_a_probe_that_stood_is_not(stood, good, run):
    """At 5 s the run came out more than twice as long as it was."""
    time_s = good.frames.time_s + np.where(np.arange(COUNT) >= 30, 5.0, 0.0)
    read_s = np.linspace(-1, 8, 900)
    moved_s = read_s - np.clip(read_s - good.frames.time_s[30], 0, 5) if stood else read_s
    encoder = Encoder(read_s, 30 * STEP_MM * moved_s)
    spoiled = replace(good, frames=replace(good.frames, time_s=time_s), listed=None, encoder=encoder)
    found, told = checked(spoiled, run.probe)
    np.testing.assert_allclose(found.time_s, time_s if stood else good.frames.time_s, atol=1e-6)
    assert len(told) == (not stood)
    assert stood or "jumps by 5 s before frame 30" in told[0]


@pytest.mark.parametrize("first", [20, 31], ids=["laser-led", "led-laser"])
@pytest.mark.parametrize("apart", [1, 2])
def test_pictures_in_another_order_are_left_out_and_nothing_was_lost(first, apart, good, run):
    """Neighbours exchanged in five places were told as "10 pictures lost", and 100 times were wrong."""
    lit = first + (apart == 2 and first % 2 == 0)
    order, wrong = np.arange(COUNT), [lit, lit + apart]
    order[wrong] = order[wrong[::-1]]
    shown = {k: good.source.images[order[k]] for k in range(COUNT)}
    spoiled = replace(good, source=MemorySource(shown, run.probe.camera.image_size))
    found, told = checked(spoiled, run.probe)
    assert found.frame.tolist() == [k for k in range(COUNT) if k not in wrong]
    np.testing.assert_allclose(found.time_s, good.frames.time_s[found.frame])
    assert len(told) == 1
    assert "2 pictures were stored in another order" in told[0]


@pytest.mark.parametrize("outside", [slice(0, 20), slice(40, COUNT)], ids=["before", "behind"])
def test_pictures_from_outside_the_pipe_are_left_out(outside, good, run):
    """A run that began outside ended with a fault of the program, after 4 pictures that were lost."""
    width, height = run.probe.camera.image_size
    draw = np.random.default_rng(1)
    rooms = {
        int(k): draw.uniform(0, 30 if k % 2 == 0 else 150, (height, width)) for k in range(COUNT)[outside]
    }
    away, shown = list(rooms), {k: room.astype(np.uint8) for k, room in rooms.items()}
    source = MemorySource({**good.source.images, **shown}, run.probe.camera.image_size)
    found, told = checked(replace(good, source=source), run.probe)
    assert set(found.frame.tolist()) & set(away) <= {39, 41}
    np.testing.assert_allclose(found.time_s, good.frames.time_s[found.frame])
    assert len(told) == 1
    assert "before the first laser line or behind the last" in told[0]
