"""Light on the wall while the LEDs are off, on synthetic pictures: named by what it falls on."""

from types import SimpleNamespace

import numpy as np
import pytest

from stages.twin.cells import chance_of
from stages.twin.gate import judged
from stages.twin.glow import LIGHT
from stages.twin.picture import WholePictures
from stages.twin.stray_light import STRAY_NAMES, brings_light
from tests.unit.whole_pictures import (
    AWAY,
    FRAMES,
    OUTSIDE,
    SCENE,
    WHITE,
    line_of_laser,
    lit_wall,
    named,
    noisy,
    shown_of,
    twin_of,
)


def test_stray_light_is_named_by_what_it_falls_on():
    glow = 8 * np.exp(-0.5 * ((AWAY - 70) / 25) ** 2)
    (name,) = named(laser=lambda p, r: p + glow)
    assert "interreflection" in name
    # Even light on all of the wall is no known pattern: it is one of several causes.
    assert named(laser=lambda p, r: p + 5) == [LIGHT]
    assert named(laser=lambda p, r: p + 0.5) == []


def _stray_names(light, scene=SCENE, dark=OUTSIDE):
    """Return the confirmed names of light that wall of mean reflectance 1 reflects with the LEDs off.

    Light of no known pattern has the name of a class.

    The wall ends where it is ``dark``; the scene defines how far the LEDs light it.
    """
    random, whole, shown = np.random.default_rng(2), WholePictures(scene), {}
    for frame in range(FRAMES):
        wall, line = lit_wall(random), line_of_laser()
        lit = twin_of((wall.level * np.exp(-((AWAY / 80) ** 2))).astype(np.float32), wall.region)
        seen = noisy(line.level + np.where(dark, 0, light(wall.level / 90)), random)
        whole.add_laser(frame, seen, line, seen < WHITE, lit)
        shown[frame] = shown_of(seen, line, lit, frame, whole)
    kept, withdrawn = judged(whole.suspected(np.zeros(4)), lambda frames: [(f, shown[f]) for f in frames])
    assert not withdrawn
    return [m.name for m in kept]


def test_uniform_light_on_unevenly_lit_wall_is_ambient_light():
    """It was expected to follow the light of the lamps, which falls off: it was named interreflection."""
    assert _stray_names(lambda pale: 22 * pale) == ["ambient_light"]


def test_uniform_light_on_wall_that_no_lamp_reaches_is_found_from_darker_places():
    """Wall behind the LEDs was taken for black: light on it hid the light on all of the wall."""
    reached = SimpleNamespace(**{**vars(SCENE), "outside": AWAY > 110})
    assert _stray_names(lambda pale: 22 * pale, reached) == ["ambient_light"]
    assert _stray_names(lambda pale: 6 * (pale - 1), reached) == [LIGHT]
    assert _stray_names(lambda pale: 6 * (pale - 1), reached, AWAY > 110) == []


@pytest.mark.parametrize("haze", [0.0, 20.0, -6.0])
def test_texture_of_lit_frames_kept_by_a_codec_is_not_light(haze):
    """A pattern with mean 0, or another mean, was ambient light at a chance of 1e-15."""
    assert _stray_names(lambda pale: 6 * (pale - 1) + haze) == [LIGHT] * (haze > 0)


def test_a_pattern_is_not_light_because_the_pictures_flicker():
    """The wall's mean, too uncertain to contradict, counted as agreement: this was ambient light."""
    random = np.random.default_rng(4)
    assert _stray_names(lambda pale: 6 * (pale - 1) + random.normal(0, 8)) == [LIGHT]


def test_without_a_place_that_sees_no_wall_uniform_light_is_not_reported():
    assert _stray_names(lambda pale: 22 * pale, SimpleNamespace(**{**vars(SCENE), "outside": None})) == []


def test_frames_that_see_black_are_evidence_of_light_for_those_that_do_not():
    """One frame without black invalidated the evidence of all others, for ambient light or against it."""
    mean, bright = np.full(8, 4.0), np.array([0.1, -0.1, 0, 0.1, -0.1, 0.1, 0, np.nan])
    assert all(brings_light(law, mean, bright) for law in range(3))
    assert not any(brings_light(law, mean, bright - 4) for law in range(3))
    assert not any(brings_light(law, mean, np.where(np.arange(8) < 1, 0, np.nan)) for law in range(3))


SIZES = np.array([1.0, 0.7, 1.3, 0.9, 1.1, 0.8, 1.2, 1.0])


def _frames_of_law(law, more):
    """Return frames that one law fits, with wall so many grey levels brighter than it predicts."""
    whole = WholePictures(SCENE)
    whole.stray = [np.tile([0.1, 100, 0, 9, more], (3, 1)) for _ in SIZES]
    for frame, s in zip(whole.stray, SIZES, strict=True):
        frame[law] = [s, 100, 5, 90 * s, more]
    whole.frame["stray"] = list(range(len(SIZES)))
    return whole


def test_the_best_of_three_laws_has_three_times_the_chance():
    assert _frames_of_law(2, 0)._stray().mismatch.probability == pytest.approx(3 * chance_of(SIZES))


@pytest.mark.parametrize("law", [0, 1, 2])
def test_without_a_place_that_sees_no_wall_no_light_is_reported(law):
    """Light reflected once was reported from its pattern alone, which the residue of a codec may share."""
    assert _frames_of_law(law, 0.0)._stray().mismatch.name == STRAY_NAMES[law]
    assert _frames_of_law(law, np.nan)._stray() is None
