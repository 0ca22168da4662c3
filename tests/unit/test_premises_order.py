"""Pictures that are repeated or exchanged, and a clock that jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.recording.base import Encoder, FrameTable
from stages.premises.light import Light
from stages.premises.losses import Steps, rows_by_motion, sway_of_line
from stages.premises.pictures import Pictures, examine_pictures
from tests.drawn_run import drawn_run
from tests.premises_run import COUNT, STEP_MM, checked, with_rings
from tests.quiet import quiet_context
from tests.ring_images import MemorySource
from tests.spoiled_recordings import (
    KeptFrames,
    Spoiled,
    repeated,
)


def test_repeated_pictures_are_left_out(good, run):
    spoiled: Spoiled = repeated(good, np.random.default_rng(1))
    found, told = checked(spoiled.recording, run.probe)
    assert len(found.frame) == len(spoiled.recording.frames.frame) - 1
    assert np.all(np.diff(found.time_s) > 0)
    assert any("they repeat the picture before" in t for t in told)


@pytest.mark.parametrize("often", [8, 11])
@pytest.mark.parametrize("by_picture", [True, False])
def test_the_encoder_shows_whether_times_move_up_behind_inserted_pictures(often, by_picture, good, run):
    """By the lights alone they always did, or never: the encoder "slipped" at every such picture."""
    kept = np.sort(np.r_[np.arange(COUNT), 9:COUNT:often])
    time_s = np.arange(len(kept)) / 30
    illumination = np.where(np.arange(len(kept)) % 2 == 0, "laser", "led")
    encoder = Encoder(time_s, STEP_MM * kept) if by_picture else good.encoder
    table = FrameTable(np.arange(len(kept)), time_s, illumination)
    spoiled = replace(good, frames=table, source=KeptFrames(good.source, kept), encoder=encoder)
    found, told = checked(spoiled, run.probe)
    new = np.diff(kept, prepend=-1) > 0
    assert found.frame.tolist() == np.flatnonzero(new).tolist()
    np.testing.assert_allclose(found.time_s, time_s[new] if by_picture else time_s[:COUNT])
    assert any("now have the times of earlier rows" in t for t in told) != by_picture
    assert not any("lost" in t for t in told)


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
    assert f"{count} picture{'s' * (count > 1)} left out, since the recorder hung" in told[0]


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
    assert f"{again.sum()} pictures left out, since the recorder hung" in told[0]


@pytest.mark.parametrize("encoder", ["goes on", "none"])
@pytest.mark.parametrize("count", [5, 15])
def test_pictures_of_a_recorder_that_repeats_each_light_are_left_out(count, encoder, good, run):
    """After a second of such repeats "42 pictures were lost", and the run became 12 % too long."""
    frame = np.arange(COUNT)
    hung = (frame >= 22) & (frame < 22 + count)
    shown = {k: good.source.images[20 + k % 2 if hung[k] else k] for k in frame}
    spoiled = replace(good, source=MemorySource(shown, run.probe.camera.image_size))
    spoiled = spoiled if encoder == "goes on" else replace(spoiled, encoder=None)
    found, told = checked(spoiled, run.probe)
    assert found.frame.tolist() == frame[~hung].tolist()
    np.testing.assert_allclose(found.time_s, good.frames.time_s[~hung])
    assert len(told) == 1
    assert f"{count} picture{'s' * (count > 1)} left out, since the recorder hung" in told[0]


def test_pictures_of_a_probe_that_stops_are_not_repeats():
    z = np.concatenate([np.arange(20), np.full(20, 20), 20 + np.arange(20)])
    halting = drawn_run(STEP_MM * z, 0.0 * z)
    found, _ = checked(with_rings(halting), halting.probe)
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
    assert any("they repeat the picture before" in t for t in told)


def test_varying_speed_over_pictures_left_out_is_not_a_loss():
    """After a camera hung for a second, 6 pictures "were lost": the probe had moved 20 % faster meanwhile."""
    frame = np.arange(0, 120, 2)
    there = (frame < 60) | (frame >= 90)
    place = np.cumsum(np.where(there, 0.02 + 0.001 * np.sin(frame / 3), 0.024))
    seen, way = frame[there], place[there]
    steps = Steps(seen[:-1], seen[1:], np.diff(way))
    table = FrameTable(np.arange(120), np.arange(120) / 30, np.full(120, "led"))
    encoder = Encoder(table.time_s, 10.0 * table.time_s)
    row = rows_by_motion(np.arange(120), steps, 2, table, encoder, np.ones(120))
    np.testing.assert_array_equal(row, np.arange(120))


@pytest.mark.parametrize(("mm_a_frame", "lost"), [(1.0, 2), (-1.0, 2), (2.0, 0), (-2.0, 0)])
def test_steps_that_a_codec_holds_back_are_not_a_loss(mm_a_frame, lost):
    """Blocks of a codec stood still, most steps were half as long, and the others seemed lost pictures."""
    frame = np.arange(0, 120, 2)
    size = np.where(frame[1:] == 60, 0.04, 0.02) + 0.0001 * np.sin(frame[1:])
    table = FrameTable(np.arange(120), np.arange(120) / 30, np.full(120, "led"))
    encoder = Encoder(table.time_s, 30 * mm_a_frame * table.time_s)
    steps = Steps(frame[:-1], frame[1:], size)
    row = rows_by_motion(np.arange(120), steps, 2, table, encoder, np.ones(120), radius_mm=100.0)
    assert row[-1] - 119 == lost


@pytest.mark.parametrize("first", [20, 21])
def test_all_pictures_of_exchanged_blocks_are_left_out_and_none_is_lost(first, good, run):
    """20 pictures "were lost" where two blocks of ten had been stored in exchanged order."""
    middle, last = first + 10, first + 20
    order = np.r_[0:first, middle:last, first:middle, last:COUNT]
    shown = {k: good.source.images[order[k]] for k in range(COUNT)}
    spoiled = replace(good, source=MemorySource(shown, run.probe.camera.image_size))
    found, told = checked(spoiled, run.probe)
    left_out = np.setdiff1d(np.arange(COUNT), found.frame)
    assert set(range(first, last)) <= set(left_out) <= set(range(first - 1, last + 1))
    np.testing.assert_allclose(found.time_s, good.frames.time_s[found.frame])
    assert len(told) == 1
    assert "left out: stored in another order than taken" in told[0]


@pytest.mark.parametrize("knocked", [False, True])
def test_a_camera_knocked_during_a_run_is_not_a_loss(knocked):
    """Its pictures moved by 4 px, the wall seemed to jump, and times were taken from other rows."""
    frame = np.arange(0, 120, 2)
    size = np.where(frame[1:] == 60, 0.04, 0.02) + 0.0001 * np.sin(frame[1:])
    table = FrameTable(np.arange(120), np.arange(120) / 30, np.full(120, "led"))
    encoder = Encoder(table.time_s, 10.0 * table.time_s)
    azimuth = np.linspace(-np.pi, np.pi, 128, endpoint=False)
    moved = 0.4 * np.sin(frame / 5) + 4 * knocked * (frame + 1 >= 60)
    line = np.full((120, 128), np.nan, np.float32)
    line[1::2] = 100 + np.round(moved[:, None] * np.cos(azimuth))
    nothing, light = np.full(120, np.nan), np.tile([Light.WALL, Light.LINE], 60)
    pictures = Pictures(nothing, np.ones(120), line, azimuth, nothing, np.full(120, -1), nothing, nothing)
    sway = sway_of_line(pictures, light)
    row = rows_by_motion(np.arange(120), Steps(frame[:-1], frame[1:], size), 2, table, encoder, sway)
    assert row[-1] - 119 == (0 if knocked else 2)


@pytest.mark.parametrize(("turns", "lost"), [(False, 2), (True, 0)])
def test_where_a_probe_turns_back_a_longer_step_is_not_a_loss(turns, lost):
    """The steps in a gauge differ with its bores; at a turn up to 44 pictures "were lost"."""
    frame = np.arange(0, 120, 2)
    size = np.where(frame[1:] == 60, 0.04, 0.02) + 0.0001 * np.sin(frame[1:])
    table = FrameTable(np.arange(120), np.arange(120) / 30, np.full(120, "led"))
    way_mm = 30 * table.time_s
    encoder = Encoder(table.time_s, np.where(turns & (way_mm > 64), 128 - way_mm, way_mm))
    steps = Steps(frame[:-1], frame[1:], size)
    row = rows_by_motion(np.arange(120), steps, 2, table, encoder, np.ones(120))
    assert row[-1] - 119 == lost


@pytest.mark.parametrize(("broken", "lost"), [(10, 10), (1, 0)])
def test_a_doubtful_break_of_the_rhythm_is_a_loss_if_most_breaks_are(broken, lost):
    """One picture in six is lost, and one of the breaks is half as clear as the others."""
    passed = np.full(40, 2)
    passed[1 : 2 * broken : 2] = 3
    frame = np.r_[0, np.cumsum(passed)]
    clear = np.where(np.arange(40) == 2 * broken - 1, 0.55, 1.0)
    size = 0.02 * (passed + clear * (passed == 3)) + 0.006 * np.sin(np.arange(40.0))
    table = FrameTable(np.arange(130), np.arange(130) / 30, np.full(130, "led"))
    encoder = Encoder(table.time_s, 30 * table.time_s)
    row = rows_by_motion(
        np.arange(frame[-1] + 1), Steps(frame[:-1], frame[1:], size), 2, table, encoder, np.ones(130)
    )
    assert row[-1] - frame[-1] == lost


@pytest.mark.parametrize("stood", [False, True])
def test_a_jump_of_the_clock_is_removed_and_a_standing_probe_is_not_taken_for_one(stood, good, run):
    """With a jump of 5 s the run was more than twice as long as it should be."""
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
@pytest.mark.parametrize("apart", [1, 2, 4, 8])
def test_pictures_in_another_order_are_left_out_and_no_loss_is_reported(first, apart, good, run):
    """Neighbours exchanged in five places were reported as "10 pictures lost", and 100 times were wrong."""
    lit = first + (apart > 1 and first % 2 == 0)
    order, wrong = np.arange(COUNT), [lit, lit + apart]
    order[wrong] = order[wrong[::-1]]
    shown = {k: good.source.images[order[k]] for k in range(COUNT)}
    spoiled = replace(good, source=MemorySource(shown, run.probe.camera.image_size))
    found, told = checked(spoiled, run.probe)
    assert found.frame.tolist() == [k for k in range(COUNT) if k not in wrong]
    np.testing.assert_allclose(found.time_s, good.frames.time_s[found.frame])
    assert len(told) == 1
    assert "2 pictures left out: stored in another order" in told[0]


@pytest.fixture(scope="module")
def smooth(good, run):
    """Return the recording with noise instead of texture on the lit wall."""
    random = np.random.default_rng(3)
    lit = set(good.frames.frame[good.frames.illumination == "led"].tolist())
    shown = {
        k: np.clip(90 + 2 * random.standard_normal(i.shape), 0, 255).astype(np.uint8) if k in lit else i
        for k, i in good.source.images.items()
    }
    return replace(good, source=MemorySource(shown, run.probe.camera.image_size))


def test_pictures_without_texture_do_not_show_their_order(smooth, run):
    found, told = checked(smooth, run.probe)
    assert found.frame.tolist() == list(range(COUNT))
    assert not told


def test_pictures_without_texture_show_no_motion(smooth, good, run):
    lit = good.frames.illumination == "led"
    moved, none = (examine_pictures(r, run.probe, quiet_context()).step[lit] for r in (good, smooth))
    assert np.isfinite(moved).mean() > 0.9, "control: texture shows it"
    assert not np.isfinite(none).any()
