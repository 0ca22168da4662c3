"""Uneven lamps and flicker, on synthetic light: found where they are, and nowhere else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.instrument.probe import Lighting
from stages.twin.cells import SECTORS, Cells
from stages.twin.lamp_light import Course, LampLight
from stages.twin.lamps import (
    beside_measured,
    faded,
    flicker_of_measured,
    separated_from_wall,
    uneven_lamps,
)
from stages.twin.laws import dim_share
from stages.twin.over_time import changes_over_time
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring
from stages.twin.switched import share_at

RING = Ring((160.0, 120.0), 90.0, 50.0, 25.0)
LIGHTING = Lighting(leds=8, radius_mm=11.0)
SCENE = SimpleNamespace(
    probe=SimpleNamespace(lighting=LIGHTING), ring=RING,
    surface=SimpleNamespace(radius_mm=np.full((9, 12), 50.0)),
)  # fmt: skip


def _lamp(change):
    """A lamp whose pattern is a change (S,) of the logarithm of light around the picture."""
    azimuth = -np.pi + 2 * np.pi * (np.arange(36) + 0.5) / 36
    pattern = np.array([f(m * azimuth) @ change / 18 for m in (1, 2) for f in (np.cos, np.sin)])
    course = Course(np.array([0]), np.zeros(1), np.zeros(1))
    return LampLight(1.0, np.array([0.88, 0.92]), np.zeros(2), np.zeros(2), pattern, np.full(4, 1e-3), course)


def test_a_dim_led_is_distinguished_from_lamps_that_shine_unevenly():
    frames, azimuth = np.arange(8), -np.pi + 2 * np.pi * (np.arange(36) + 0.5) / 36
    for lost in (0.5, 1.0):
        share = dim_share(LIGHTING, 2.0, 50.0, np.array([0.9])).mean((0, 1))
        (dim,) = uneven_lamps(_lamp(np.log1p(-0.999 * lost * share)), SCENE, frames)
        assert dim.mismatch.name.startswith("led_dead")
        assert dim.mismatch.place[0].value == pytest.approx(np.degrees(2.0), abs=2)
        assert dim.mismatch.parameters[0].value == pytest.approx(lost, abs=0.03)
    (other,) = uneven_lamps(_lamp(0.2 * np.cos(2 * azimuth) + 0.05 * np.cos(azimuth)), SCENE, frames)
    assert other.mismatch.name == ""
    assert not uneven_lamps(_lamp(0 * azimuth), SCENE, frames)


def _seen_by_a_probe(rolled_deg, change, light=lambda at: 0 * at):
    """Return a scene, and the blocks of frames of a probe that moves on and rolls.

    ``change`` is that of the logarithm of brightness by azimuth in the image, on the wall, and polar angle.
    """
    frames = 12
    frame, row, column = (a.ravel() for a in np.mgrid[0:frames, 0:16, 0:24])
    v, u = np.mgrid[0:128, 0:192].astype(np.float32)
    phi, theta = np.arctan2(v - 64, u - 96), np.hypot(v - 64, u - 96) / 60
    at, angle = (a[4::8, 4::8][row, column] for a in (phi, theta))
    on_wall = np.mod(at + np.radians(rolled_deg) * np.sin(frame), 2 * np.pi).astype(np.float32)
    noise = 0.003 * np.random.default_rng(1).standard_normal(len(at))
    along = (8 * np.hypot(row - 7.5, column - 11.5) + 4 * frame).astype(int)
    around = (128 / 2 / np.pi * on_wall).astype(int)
    samples = BlockSamples(
        np.expm1(change(at, on_wall, angle) + noise), 4 + 0 * at, 32 + 0 * at, frame, row, column,
        along, around, 0.0, 2.5, np.arange(frames), row / 40, light(at),
    )  # fmt: skip
    return SimpleNamespace(probe=SCENE.probe, ring=RING, polar=(theta, phi, None)), samples


@pytest.mark.parametrize(
    ("rolled_deg", "of", "kept"),
    [(40, "lamps", 1), (40, "photo", 0), (40, "response", 0), (0, "lamps", 0)],
)
def test_lamps_are_uneven_only_where_wall_seen_twice_shows_it(rolled_deg, of, kept):
    lamp = _lamp(0.05 * np.cos(np.linspace(-np.pi, np.pi, 37)[:-1] + np.pi / 36))

    def light(at):  # a probe off the axis lights one side more
        """a probe off the axis lights one side more"""
        return -0.6 * np.cos(at) if of == "response" else 0 * at

    def change(at, on_wall, theta):
        # Either the lamps are as the twin assumes, or its photo contains the difference.
        of_photo = 0 * at if of == "lamps" else lamp.around(on_wall) - lamp.around(at)
        return of_photo + (0.92 - 1) * light(at)  # a response of .92 makes as much of that light as lamps do

    scene, samples = _seen_by_a_probe(rolled_deg, change, light)
    told, withdrawn = separated_from_wall(uneven_lamps(lamp, scene, np.arange(8)), lamp, scene, samples)
    assert (len(told), len(withdrawn)) == (kept, 1 - kept)
    assert all(("too dark" in w.statement) == (of == "photo") for w in withdrawn)
    assert all(("would look the same" in w.statement) == (of != "photo") for w in withdrawn)


@pytest.mark.parametrize("of", ["lamps", "photo"])
def test_a_dim_led_is_found_without_roll_where_the_wall_comes_nearer(of):
    """An LED gives another share of the light to the same wall when that is at another polar angle."""
    wide = replace(LIGHTING, radius_mm=30.0)  # an LED that is near shows its second harmonic
    lamp = _lamp(np.log1p(-0.999 * dim_share(wide, 2.0, 50.0, np.array([0.9])).mean((0, 1))))
    scene, _ = _seen_by_a_probe(0, lambda at, on_wall, theta: 0 * at)
    scene.probe = SimpleNamespace(lighting=wide)
    (suspected,) = uneven_lamps(lamp, scene, np.arange(8))
    assert suspected.mismatch.name == "led_dead"
    lost, azimuth = suspected.sizes[0]

    def change(at, on_wall, theta):
        of_lamps = np.log1p(-min(lost, 0.999) * share_at(scene, azimuth, theta, at))
        return (of_lamps if of == "lamps" else 0 * at) - lamp.around(at)

    told, withdrawn = separated_from_wall([suspected], lamp, scene, _seen_by_a_probe(0, change)[1])
    assert (len(told), len(withdrawn)) == (of == "lamps", of == "photo")
    assert all("too dark" in w.statement for w in withdrawn)


def test_lights_that_flicker_in_step_with_the_compared_frames_are_found_in_the_measured_ones():
    random = np.random.default_rng(2)

    def told(spread, found=(), drift=0.0):
        log = spread * random.standard_normal(12) + np.linspace(0, drift, 12)
        course = Course(np.arange(12), log, np.full(12, 1e-3))
        state = SimpleNamespace(
            lamp=replace(_lamp(np.zeros(36)), gain=course), line=None, line_is_clipped=False
        )
        return flicker_of_measured(state, found, RING)

    (flicker,) = told(0.06)
    assert flicker.parameters[0].value == pytest.approx(0.06, abs=2 * flicker.parameters[0].sd)
    assert not told(0.004)
    assert not told(0.06, (flicker,))
    assert not told(0.002, drift=0.5), "a slow change is not flicker"
    sizes = [p for _ in range(300) for m in told(0.06) for p in m.parameters]
    assert np.mean([abs(p.value - 0.06) < 2 * p.sd for p in sizes]) > 0.88


@pytest.mark.parametrize("swings", [True, False])
def test_an_exposure_that_swings_slowly_is_no_flicker_and_one_that_compared_frames_miss_is(swings):
    """An exposure that swung by .35, 1.3 times in the run, was told as flicker of 15 % and of 13 %."""
    frame, compared = 6 * np.arange(12), 6 * np.arange(9) + 5
    curve = np.log1p(0.35 * np.sin(0.115 * np.arange(72)))
    flicker = 0.1 * np.random.default_rng(4).standard_normal(72)
    light = curve if swings else np.where(np.isin(np.arange(72), compared), 0.0, flicker)
    own = np.full((9, SECTORS), 1e5)
    ratio = np.exp(light[compared])[:, None]
    cells = Cells(compared, own * ratio**2, own * ratio, own, np.full(own.shape, 500.0), own)
    course = Course(frame, light[frame], np.full(12, 1e-3))
    state = SimpleNamespace(lamp=replace(_lamp(np.zeros(36)), gain=course), line=None, line_is_clipped=False)
    assert len(flicker_of_measured(state, (), RING)) == 1
    assert len(flicker_of_measured(state, (), RING, (cells, None))) == (not swings)


@pytest.mark.parametrize(("spread", "name"), [(0.06, "flicker"), (0.005, "")])
def test_flicker_that_measured_frames_do_not_show_has_no_name(spread, name):
    """In shining steel, compared frames varied by 3.9 % and measured ones by .5 %: it was told as flicker."""
    size = (NamedFigure("exposure", 0.039, 0.005, "relative"),)
    told = Mismatch("flicker", "intensity", "time", (), size, 1e-4, 2.0, 1.0, "Frames vary.", None)
    log = spread * np.random.default_rng(2).standard_normal(12)
    lamp = replace(_lamp(np.zeros(36)), gain=Course(np.arange(12), log, np.full(12, 1e-3)))
    state = SimpleNamespace(lamp=lamp, line=None, line_is_clipped=False)
    other = replace(told, name="lamp_step")
    made = beside_measured((told, other), state)
    assert [m.name for m in made] == [name, "lamp_step"]
    assert made[1] == other


def test_flicker_that_the_photo_may_explain_is_told_once(monkeypatch):
    """Measured frames that varied less than half as much were flicker that compared ones do not show."""
    size = (NamedFigure("exposure", 0.25, 0.02, "relative"),)
    told = Mismatch("flicker", "intensity", "time", (), size, 1e-4, 2.0, 1.0, "Frames vary.", None)
    log = 0.08 * np.random.default_rng(2).standard_normal(12)
    lamp = replace(_lamp(np.zeros(36)), gain=Course(np.arange(12), log, np.full(12, 1e-3)))
    state = SimpleNamespace(lamp=lamp, line=None, line_is_clipped=False)
    monkeypatch.setattr("stages.twin.over_time.causes", lambda *_: ((told,), ()))
    monkeypatch.setattr("stages.twin.over_time.colour_over_run", lambda *_: ())
    sums = SimpleNamespace(cells=lambda: (None, None), fine=SimpleNamespace(step=lambda _: ()))
    (one,), _ = changes_over_time(sums, None, SCENE, state, ())
    assert one == beside_measured((told,), state)[0] != told


@pytest.mark.parametrize("frames", [12, 13])
def test_lights_that_alternate_between_measured_frames_flicker(frames):
    """Of 11 steps 6 were alike: about their median they did not vary, and "by .0 % only" was told."""
    log = 0.1 * (-1.0) ** np.arange(frames) + 0.005 * np.random.default_rng(2).standard_normal(frames)
    course = Course(6 * np.arange(frames), log, np.full(frames, 1e-3))
    state = SimpleNamespace(lamp=replace(_lamp(np.zeros(36)), gain=course), line=None, line_is_clipped=False)
    (told,) = flicker_of_measured(state, (), RING)
    assert told.name == "flicker"
    assert beside_measured((told,), state) == (told,)
    drifting = replace(course, log_value=np.linspace(0, 2, frames))
    assert drifting.spread == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("clipped", [False, True])
def test_a_clipped_line_shows_no_flicker_of_the_laser(clipped):
    log = 0.2 * np.random.default_rng(2).standard_normal(12)
    line = SimpleNamespace(course=Course(np.arange(12), log, np.full(12, 1e-3)))
    told = flicker_of_measured(SimpleNamespace(lamp=None, line=line, line_is_clipped=clipped), (), RING)
    assert [m.name for m in told] == ([] if clipped else ["laser_flicker"])


def test_a_laser_that_dims_slowly_is_reported_without_a_name_and_first_frames_without_photo_do_not_show_it():
    random = np.random.default_rng(3)

    def told(change, found=(), first=0.35):
        log = np.linspace(0, np.log1p(change), 12) + 0.03 * random.standard_normal(12)
        log[0] += first
        line = SimpleNamespace(course=Course(8 * np.arange(12), log, np.full(12, 1e-3)))
        return faded(SimpleNamespace(lamp=None, line=line, line_is_clipped=False), found, RING)

    (fade,) = told(-0.5)
    assert (fade.name, fade.channel, fade.fixed_to) == ("", "line", "time")
    assert "darker than" in fade.statement
    assert not told(-0.5, (replace(fade, name="laser_step"),)), "a step was already reported"
    assert not any(m for _ in range(100) for m in (*told(0.0), *told(0.0, first=-0.5)))
    sizes = [p for _ in range(300) for m in told(-0.5) for p in m.parameters]
    assert len(sizes) > 290
    assert np.mean([abs(p.value + 0.5) < 2 * p.sd for p in sizes]) > 0.93
