"""The light of pictures, and the motion of the wall in pictures that are cropped."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.recording.base import Illumination, Recording
from stages.premises.labels import light_of_pictures
from stages.premises.light import Light, light_seen, look_the_same
from stages.premises.pictures import Pictures, examine_pictures
from tests.drawn_run import RADIUS, DrawnRun
from tests.premises_run import STEP_MM
from tests.quiet import quiet_context
from tests.ring_images import MemorySource

COUNT = 60
LIT = np.arange(COUNT) % 2 == 1


@pytest.mark.parametrize(("brighter", "told"), [(0.03, False), (0.08, True)])
def test_two_lights_differ_in_brightness(brighter: float, told: bool) -> None:
    """Two joined runs of open-3, in one light, differ by a hundredth of their brightness."""
    brightness = 10 * (1 + brighter * LIT) + 0.01 * np.random.default_rng(1).standard_normal(COUNT)
    line, nothing = np.ones((COUNT, 1), np.float32), np.full(COUNT, np.nan)
    seen = Pictures(
        brightness,
        np.where(LIT, 0.0, 0.9),
        line,
        np.zeros(1),
        nothing,
        np.arange(COUNT) - 2,
        nothing,
        nothing,
    )
    expected = np.where(LIT, Light.WALL, Light.LINE) if told else np.full(COUNT, Light.UNKNOWN)
    np.testing.assert_array_equal(light_seen(seen), expected)


@pytest.mark.parametrize("lit_share", [1.0, 0.35])
def test_two_lights_are_seen_where_the_lit_pictures_become_ever_darker(lit_share: float) -> None:
    """Towards the end of a pipe they did, and all pictures "showed neither a line nor a lit wall"."""
    brightness = np.where(LIT, np.linspace(8.5, 8.5 * lit_share + 4 * (1 - lit_share), COUNT), 4.0)
    line, nothing = np.ones((COUNT, 1), np.float32), np.full(COUNT, np.nan)
    closed, partner = np.where(LIT, 0.6, 0.9), np.arange(COUNT) - 2
    seen = Pictures(brightness, closed, line, np.zeros(1), nothing, partner, nothing, nothing)
    np.testing.assert_array_equal(light_seen(seen), np.where(LIT, Light.WALL, Light.LINE))


@pytest.mark.parametrize(("label", "closed", "one"), [("both", 0.9, True), ("both", 0.1, False)])
@pytest.mark.parametrize("period", [2, 3, COUNT])
def test_a_step_or_flicker_of_both_lights_is_no_second_light(
    label: str, closed: float, one: bool, period: int
) -> None:
    """An exposure 15 % longer from half on was taken for a laser switched off: half was left out."""
    bright = np.arange(COUNT) % period >= period / 2
    line, nothing = np.ones((COUNT, 1), np.float32), np.full(COUNT, np.nan)
    seen = Pictures(
        8.5 + 0.7 * bright + 0.001 * np.random.default_rng(2).standard_normal(COUNT),
        np.where(bright, closed, 0.9), line, np.zeros(1), nothing, np.arange(COUNT) - 1, nothing, nothing,
    )  # fmt: skip
    table = SimpleNamespace(frame=np.arange(COUNT), illumination=np.full(COUNT, label))
    light = light_of_pictures(table, seen)  # type: ignore[arg-type]
    assert np.all(light == Light.UNKNOWN) == one


def test_one_light_that_changes_at_random_is_not_two() -> None:
    brightness = 8 * np.random.default_rng(1).uniform(0.5, 1, COUNT)
    line, nothing = np.ones((COUNT, 1), np.float32), np.full(COUNT, np.nan)
    seen = Pictures(
        brightness, np.ones(COUNT), line, np.zeros(1), nothing, np.arange(COUNT) - 1, nothing, nothing
    )
    assert np.all(light_seen(seen) == Light.UNKNOWN)


@pytest.mark.parametrize("hits", [300, 2000])
def test_hits_of_radiation_do_not_hide_the_line(hits: int, run: DrawnRun, good: Recording) -> None:
    """Half of a run was left out where more and more pixels were hit."""
    draw, images = np.random.default_rng(1), dict(good.source.images)
    for k, image in images.items():
        images[k] = image.copy()
        images[k].flat[draw.integers(0, image.size, hits)] = 255
    spoiled = replace(good, source=MemorySource(images, run.probe.camera.image_size))
    seen = examine_pictures(spoiled, run.probe, quiet_context())
    assert np.all(seen.closed[good.frames.illumination == "laser"] > 0.85)


def cut_off(run: DrawnRun, good: Recording, columns: int) -> tuple[Recording, DrawnRun]:
    """Return a recording whose pictures end after so many columns, and its run."""
    height = run.probe.camera.image_size[1]
    images = {k: np.ascontiguousarray(i[:, :columns]) for k, i in good.source.images.items()}
    camera = replace(run.probe.camera, image_size=(columns, height))
    recording = replace(good, source=MemorySource(images, (columns, height)))
    return recording, replace(run, probe=replace(run.probe, camera=camera))


def test_the_motion_of_a_wall_that_leaves_the_picture_is_right(run: DrawnRun, good: Recording) -> None:
    """The edge of the picture does not move: taken for wall, it left 26 of 29 steps unknown."""
    recording, cut = cut_off(run, good, 300)
    seen = examine_pictures(recording, cut.probe, quiet_context())
    lit = np.isin(good.frames.frame, good.frames.of(Illumination.LED))
    steps = seen.step[lit & (seen.partner >= 0)]
    # Pictures step by 4.3 rows of the unrolled wall, and phase correlation errs by up to one of them.
    assert steps == pytest.approx(2 * STEP_MM / RADIUS, rel=0.25)
    assert np.median(steps) == pytest.approx(2 * STEP_MM / RADIUS, rel=0.05)


@pytest.mark.parametrize("step", [0.0, 0.4])
def test_a_light_that_drifts_is_one_light_and_one_that_steps_is_two(step: float) -> None:
    """A table that changed to the laser half way was believed, as the lamps had warmed up by then."""
    number, random = np.arange(160), np.random.default_rng(4)
    brightness = 8.5 + 0.004 * number + 0.01 * random.standard_normal(160) + step * (number >= 80)
    nothing = np.full(160, np.nan)
    pictures = Pictures(
        brightness, np.ones(160), np.ones((160, 4), np.float32), nothing[:4], nothing, number - 1, nothing,
        nothing,
    )  # fmt: skip
    assert look_the_same(pictures, number < 80, number >= 80) is (step == 0)


@pytest.mark.parametrize("flash", [False, True])
@pytest.mark.parametrize("apart", [0.0, 4.0])
def test_one_flash_does_not_make_two_lights_equal(flash: bool, apart: float) -> None:
    """One flash within a light made all changes between the lights look usual."""
    one = np.arange(COUNT) % 20 < 10
    brightness = 10 + apart * one + 0.05 * np.random.default_rng(2).standard_normal(COUNT)
    brightness[25] += 10 * flash
    nothing = np.full(COUNT, np.nan)
    line = np.ones((COUNT, 1), np.float32)
    seen = Pictures(
        brightness, np.full(COUNT, 0.9), line, np.zeros(1), nothing, np.arange(COUNT) - 1, nothing, nothing
    )
    assert look_the_same(seen, one, ~one) is (apart == 0)


def test_a_drifting_light_continues_under_another_label_of_the_table() -> None:
    """Control: the step between the two is like all others, though the medians are far apart."""
    first = np.arange(COUNT) < COUNT // 2
    drifts = [
        10 + 0.1 * np.arange(COUNT) + 0.1 * np.random.default_rng(s).standard_normal(COUNT) for s in range(20)
    ]
    nothing, line = np.full(COUNT, np.nan), np.ones((COUNT, 1), np.float32)
    seen = [
        Pictures(d, np.full(COUNT, 0.9), line, np.zeros(1), nothing, np.arange(COUNT) - 1, nothing, nothing)
        for d in drifts
    ]
    assert all(look_the_same(s, first, ~first) for s in seen)
