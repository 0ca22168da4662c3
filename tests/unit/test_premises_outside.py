"""Pictures from outside the pipe, before the probe enters and after it leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stages.premises.light import Light
from stages.premises.order import behind_the_end, off_the_pipe
from stages.premises.pictures import Pictures
from tests.premises_run import COUNT, checked, ring_image
from tests.ring_images import MemorySource


@pytest.mark.parametrize("outside", [slice(0, 20), slice(40, COUNT)], ids=["before", "behind"])
def test_pictures_from_outside_the_pipe_are_left_out(outside, good, run):
    """A run that began outside ended with a program error, after 4 pictures reported as lost."""
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
    assert "before the first laser line or after the last" in told[0]


def test_pictures_from_outside_are_all_that_is_told_where_lamps_and_laser_are_always_on(good, run):
    """All other pictures, too, "showed neither a laser line in the dark nor a lit wall"."""
    line = good.source.images[0]
    shown = {k: line if k < 40 else np.full_like(line, 60) for k in range(COUNT)}
    table = replace(good.frames, illumination=np.full(COUNT, "both"))
    source = MemorySource(shown, run.probe.camera.image_size)
    found, told = checked(replace(good, frames=table, source=source, encoder=None), run.probe)
    assert found.frame.max() == 39
    assert sum("before the first laser line or after the last" in t for t in told) == 1
    assert not any("neither" in t for t in told)


def test_the_rim_of_a_lit_pipe_is_not_the_laser_line():
    """The rim at the end of a pipe is a closed line as well, and pictures without the laser's were kept."""
    frame = np.arange(COUNT)
    light = np.where(frame % 2 == 0, Light.LINE, Light.WALL)
    closed = np.where((light == Light.WALL) | (frame < 30), 0.9, 0.0)
    line, nothing = np.full((COUNT, 128), 100, np.float32), np.full(COUNT, np.nan)
    pictures = Pictures(
        np.ones(COUNT), closed, line, np.zeros(128), nothing, np.full(COUNT, -1), nothing, nothing
    )
    assert np.flatnonzero(off_the_pipe(pictures, light)).tolist() == list(range(29, COUNT))
    assert not off_the_pipe(pictures, np.full(COUNT, Light.UNKNOWN)).any(), "control: any closed line counts"


def test_pictures_behind_the_end_of_a_pipe_are_left_out_where_most_show_no_line(good, run):
    """Too few dark pictures showed the laser's line to tell the lights, and the rim was taken for it.

    Half of the wall then lay up to 300 mm from the axis of a pipe of 51 mm radius.
    """
    shown = dict(good.source.images)
    for k in range(20, COUNT):
        lit = good.frames.illumination[k] == "led"
        shown[k] = np.maximum(shown[k], ring_image(run.probe, k)) if lit else np.full_like(shown[k], 4)
    spoiled = replace(good, source=MemorySource(shown, run.probe.camera.image_size))
    found, told = checked(spoiled, run.probe)
    assert found.frame.max() in (18, 19)
    assert sum("before the first laser line or after the last" in t for t in told) == 1


@pytest.mark.parametrize(("still", "count"), [(True, COUNT - 39), (False, 0)])
def test_the_pipe_has_ended_only_if_the_wall_no_longer_moves(still, count, good, run):
    """The laser was switched off before the end of a run, and texture of the wall ahead was not used."""
    dark = np.random.default_rng(1)
    size = good.source.images[0].shape
    changed = {k: dark.integers(0, 4, size).astype(np.uint8) for k in range(40, COUNT, 2)}
    if still:
        changed |= {k: good.source.images[39] for k in range(41, COUNT, 2)}
    source = MemorySource({**good.source.images, **changed}, run.probe.camera.image_size)
    found, _ = checked(replace(good, source=source), run.probe)
    assert found.behind_end == count


def test_where_nothing_is_lit_behind_the_last_line_there_is_no_sign_of_an_end():
    outside, step = np.arange(COUNT) >= 40, np.full(COUNT, 0.1)
    light = np.where(np.arange(COUNT) % 2 == 0, Light.LINE, Light.WALL)
    nothing = np.full(COUNT, np.nan)
    seen = Pictures(nothing, nothing, nothing, nothing, nothing, np.full(COUNT, -1), nothing, step)
    assert behind_the_end(seen, outside, np.where(outside, Light.LINE, light)) == 0
    assert behind_the_end(seen, np.zeros(COUNT, bool), light) == 0
    assert behind_the_end(replace(seen, step=np.where(outside, 0.0, step)), outside, light) == COUNT - 40
