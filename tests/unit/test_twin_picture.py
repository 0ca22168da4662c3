"""Laws of whole pictures, on synthetic pictures: named where they act, and nowhere else."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from stages.twin.cells import chance_of
from stages.twin.gate import judged
from stages.twin.lamp_light import Figure
from stages.twin.line_light import _plain_line
from stages.twin.name import focus_of, response_of
from stages.twin.picture import WholePictures, _brings_light
from stages.twin.reference import BlocksOfFrames
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.switched import STRAY_NAMES, Shown, leaked

SHAPE, FRAMES, WHITE = (240, 320), 8, 200.0
V, U = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]].astype(np.float32)
AWAY, PHI = np.hypot(V - 120, U - 160), np.arctan2(V - 120, U - 160)
OUTSIDE = AWAY > 180
"""Corners of the picture, which see no wall."""
RING = Ring((160.0, 120.0), 70.0, 50.0, 25.0)
LINE_LIGHT = _plain_line(0.1, 2.4)
SCENE = SimpleNamespace(
    polar=(AWAY / 70, PHI, AWAY > 0), ring=RING, surface=SimpleNamespace(mean_radius_mm=50.0), outside=OUTSIDE
)


def _twin(level, region):
    place = (50.0 * 70 / np.maximum(AWAY, 20)).astype(np.float32)
    noise, even = np.full(SHAPE, 2.0, np.float32), np.ones(SHAPE, np.float32)
    return TwinFrame(level, noise, region.astype(np.uint8), place, PHI, even)


def _lit(random):
    fine = cv2.GaussianBlur(random.standard_normal(SHAPE).astype(np.float32), (0, 0), 2.5)
    wide = cv2.GaussianBlur(random.standard_normal(SHAPE).astype(np.float32), (0, 0), 12)
    level = 90 + 20 * fine / fine.std() + 15 * wide / wide.std()
    return _twin(np.clip(level, 15, 180).astype(np.float32), np.where(OUTSIDE, Region.DARK, Region.WALL))


def _line():
    level = 150 * np.exp(-0.5 * ((AWAY - 70) / 1.5) ** 2)
    region = np.where(abs(AWAY - 70) < 1.5, Region.LINE_CORE, Region.DARK)
    return _twin(
        level.astype(np.float32),
        np.where((region == Region.DARK) & (abs(AWAY - 70) < 9), Region.LINE_FLANK, region),
    )


def _noisy(picture, random):
    return (picture + 1.4 * random.standard_normal(SHAPE)).astype(np.float32)


def _named(lit=lambda p, r: p, laser=lambda p, r: p, of_sharpness=0.0, judge=None):
    """Return confirmed and withdrawn names; ``judge`` changes the frames that are rendered again."""
    random, whole, blocks = np.random.default_rng(2), WholePictures(SCENE), BlocksOfFrames(RING)
    shown = {}
    for frame in range(FRAMES):
        twin, line = _lit(random), _line()
        seen = np.minimum(_noisy(lit(twin.level, random), random), WHITE)
        free = seen < WHITE
        whole.add_lit(frame, seen, twin, free)
        whole.add_clipped(frame, seen, twin, free)
        blocks.add(frame, seen, twin, WHITE)
        shown[frame] = _shown(seen if judge is None else judge(twin.level, random), twin, twin, frame, whole)
        seen = _noisy(np.where(OUTSIDE, 0, laser(line.level, random)), random)
        whole.add_laser(FRAMES + frame, seen, line, seen < WHITE, twin)
        shown[FRAMES + frame] = _shown(seen, line, twin, FRAMES + frame, whole)
    state = SimpleNamespace(sharpness=np.full(4, of_sharpness), lamp=True, line=None)
    first = (*whole.suspected(state.sharpness), *response_of(blocks.samples(), RING))
    kept, withdrawn = judged(first, lambda frames: [(f, shown[f]) for f in frames])
    focus, not_focus = judged(focus_of(state, whole, kept), lambda frames: [(f, shown[f]) for f in frames])
    names = [[m.name for m in found] for found in ((*kept, *focus), (*withdrawn, *not_focus))]
    return names if judge is not None else names[0]


def _shown(seen, twin, lit, frame, whole):
    def again(sharpness=None, power=1.0):
        return (100 * (twin.level / 100) ** power).astype(np.float32)

    return Shown(seen, twin, seen < WHITE, SCENE, again, lambda: lit, whole.direction(frame))


def _moved(picture, random):
    angle = random.uniform(0, np.pi)
    steps = [
        np.float32([[1, 0, d * np.cos(angle)], [0, 1, d * np.sin(angle)]]) for d in np.linspace(-3, 3, 9)
    ]
    return np.mean([cv2.warpAffine(picture, m, SHAPE[::-1], borderMode=cv2.BORDER_REFLECT) for m in steps], 0)


def _bloomed(picture, random):
    spot = 300 * np.exp(-0.5 * (((U - 160) / 12) ** 2 + ((V - 50) / 8) ** 2))
    over = np.maximum(picture + spot - WHITE, 0).astype(np.float32)
    tail = np.exp(-np.abs(np.arange(-40, 41)) / 6.0)
    leaked = cv2.sepFilter2D(over, -1, np.ones(1), tail / tail.sum())
    return np.where(over > 0, WHITE + 50, picture + leaked)


def _clipped(picture, random):
    return np.where(np.hypot(U - 160, V - 50) < 15, WHITE + 50, picture)


def test_with_noise_alone_nothing_is_named():
    assert _named() == []
    assert _named(_clipped) == []


def test_motion_blur_is_distinguished_from_defocus():
    assert _named(_moved) == ["motion_blur"]
    assert _named(lambda p, r: cv2.GaussianBlur(p, (0, 0), 2), of_sharpness=2.0) == ["defocus"]


def test_a_name_that_frames_rendered_again_do_not_confirm_is_withdrawn():
    for change, name in (
        (_moved, "motion_blur"),
        (lambda p, r: 100 * (p / 100) ** 0.7, "response"),
        (lambda p, r: cv2.GaussianBlur(p, (0, 0), 2), "defocus"),
    ):
        blur = 2.0 if name == "defocus" else 0.0
        kept, withdrawn = _named(change, of_sharpness=blur, judge=_noisy)
        assert not kept
        assert withdrawn[0] == name


def _ring(width):
    return (150 / width * np.exp(-0.5 * ((AWAY - 70) / width) ** 2)).astype(np.float32)


@pytest.mark.parametrize(("recorded", "stands"), [(2.4, True), (1.2, False)])
def test_a_wide_line_is_kept_if_recorded_frames_fit_no_line_of_a_focused_lens(recorded, stands):
    random, region = np.random.default_rng(3), np.where(abs(AWAY - 70) < 9, Region.LINE_CORE, Region.DARK)
    line = SimpleNamespace(blur_px=Figure(2.4, 0.1))
    whole = SimpleNamespace(frames_of=lambda law: np.arange(8), scene=SCENE)
    (suspected,) = focus_of(SimpleNamespace(line=line, sharpness=np.zeros(4)), _blind(whole), ())

    def again(line):
        return _ring(line(LINE_LIGHT).blur_px.value)

    shown = [
        (
            f,
            Shown(
                _noisy(_ring(recorded), random), _twin(_ring(2.4), region), AWAY > 0, SCENE, again, None, None
            ),
        )
        for f in range(8)
    ]
    kept, withdrawn = judged([suspected], lambda frames: shown)
    assert [m.name for m in (kept if stands else withdrawn)] == ["defocus or thick_sheet"]
    assert not (withdrawn if stands else kept)


def _blind(whole):
    """A run whose lit frames show nothing of blur."""
    whole.even_blur, whole.loses_texture = lambda sharpness: np.zeros(8), False
    return whole


def test_a_displaced_photo_is_not_motion_blur():
    def displaced(picture, random):
        shift = np.float32([[1, 0, random.normal(0, 0.6)], [0, 1, random.normal(0, 0.6)]])
        return cv2.warpAffine(picture, shift, SHAPE[::-1], borderMode=cv2.BORDER_REFLECT)

    assert _named(displaced) == []


@pytest.mark.parametrize("power", [0.7, 1.3])
def test_a_response_is_named_and_light_that_falls_off_is_not(power):
    assert _named(lambda p, r: 100 * (p / 100) ** power) == ["response"]
    assert _named(lambda p, r: p * (1 - 0.3 * (AWAY / 200) ** 2)) == []


def test_a_photo_with_internal_displacements_is_not_a_response():
    def torn(picture, random):
        shift = [
            cv2.GaussianBlur(random.standard_normal(SHAPE).astype(np.float32), (0, 0), 4) for _ in range(2)
        ]
        at = [(a + 3 * s / s.std()).astype(np.float32) for a, s in zip((U, V), shift, strict=True)]
        return cv2.remap(picture, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)

    assert _named(torn) == []


def test_bloom_is_found_along_columns_only():
    assert _named(_bloomed) == ["bloom"]


@pytest.mark.parametrize("leak", [0.0, 40.0])
def test_bloom_of_a_clipped_line_is_measured_beside_it_and_not_on_its_profile(leak):
    """A line wider on some sides than its twin hid bloom of 11 %: the leak was measured on the line, too."""
    random, whole = np.random.default_rng(7), WholePictures(SCENE)
    for frame in range(8):
        twin = _line()
        wider = 60 * np.cos(2 * PHI + frame) * np.exp(-0.5 * ((abs(AWAY - 70) - 4) / 1.5) ** 2)
        full = twin.level > 140
        seen = twin.level + wider + leak * leaked(~full)[0]
        seen = np.where(full, WHITE + 50, np.minimum(_noisy(seen, random), WHITE - 1)).astype(np.float32)
        whole.add_clipped(frame, seen, twin, ~full)
    assert (whole._bloom() is not None) == (leak > 0)


def test_stray_light_is_named_by_what_it_falls_on():
    glow = 8 * np.exp(-0.5 * ((AWAY - 70) / 25) ** 2)
    (name,) = _named(laser=lambda p, r: p + glow)
    assert "interreflection" in name
    # Even light on all of the wall is no known pattern: it is reported without a name.
    assert _named(laser=lambda p, r: p + 5) == [""]
    assert _named(laser=lambda p, r: p + 0.5) == []


def _stray_names(light, scene=SCENE, dark=OUTSIDE):
    """Return the confirmed names of light that wall of mean reflectance 1 reflects with the LEDs off.

    Light of no known pattern has an empty name.

    The wall ends where it is ``dark``; the scene defines how far the LEDs light it.
    """
    random, whole, shown = np.random.default_rng(2), WholePictures(scene), {}
    for frame in range(FRAMES):
        wall, line = _lit(random), _line()
        lit = _twin((wall.level * np.exp(-((AWAY / 80) ** 2))).astype(np.float32), wall.region)
        seen = _noisy(line.level + np.where(dark, 0, light(wall.level / 90)), random)
        whole.add_laser(frame, seen, line, seen < WHITE, lit)
        shown[frame] = _shown(seen, line, lit, frame, whole)
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
    assert _stray_names(lambda pale: 6 * (pale - 1), reached) == [""]
    assert _stray_names(lambda pale: 6 * (pale - 1), reached, AWAY > 110) == []


@pytest.mark.parametrize("haze", [0.0, 20.0, -6.0])
def test_texture_of_lit_frames_kept_by_a_codec_is_not_light(haze):
    """A pattern with mean 0, or another mean, was ambient light at a chance of 1e-15."""
    assert _stray_names(lambda pale: 6 * (pale - 1) + haze) == [""] * (haze > 0)


def test_a_pattern_is_not_light_because_the_pictures_flicker():
    """The wall's mean, too uncertain to contradict, counted as agreement: this was ambient light."""
    random = np.random.default_rng(4)
    assert _stray_names(lambda pale: 6 * (pale - 1) + random.normal(0, 8)) == [""]


def test_without_a_place_that_sees_no_wall_uniform_light_is_not_reported():
    assert _stray_names(lambda pale: 22 * pale, SimpleNamespace(**{**vars(SCENE), "outside": None})) == []


def test_frames_that_see_black_are_evidence_of_light_for_those_that_do_not():
    """One frame without black invalidated the evidence of all others, for ambient light or against it."""
    mean, bright = np.full(8, 4.0), np.array([0.1, -0.1, 0, 0.1, -0.1, 0.1, 0, np.nan])
    assert all(_brings_light(law, mean, bright) for law in range(3))
    assert not any(_brings_light(law, mean, bright - 4) for law in range(3))
    assert not any(_brings_light(law, mean, np.where(np.arange(8) < 1, 0, np.nan)) for law in range(3))


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


def test_a_second_ring_is_found_and_a_glint_is_not_taken_for_one():
    second = 150 * 0.1 * np.exp(-0.5 * ((AWAY - 92) / 1.5) ** 2)
    assert _named(laser=lambda p, r: p + second) == ["second_line"]
    glint = 60 * np.exp(-0.5 * (((U - 240) / 6) ** 2 + ((V - 120) / 6) ** 2))
    assert "second_line" not in _named(laser=lambda p, r: p + glint)


def test_a_mirror_image_of_the_line_is_found_and_a_glow_about_the_line_is_not_taken_for_one():
    """It lies at another ratio of radii in each direction if the probe is askew; it had no name."""
    away = AWAY - 70 * (0.7 + 0.04 * np.cos(PHI) + 0.02 * np.sin(2 * PHI))
    assert _named(laser=lambda p, r: p + 8 * np.exp(-0.5 * (away / 1.5) ** 2)) == ["second_line"]
    for reach in (8, 25):
        glow = 40 * np.exp(-abs(AWAY - 70) / reach)
        # At most as light on the wall: a second line without a name would be another one.
        assert _named(laser=lambda p, r, more=glow: p + more) == [""] * (reach == 25)


@pytest.mark.parametrize("peak", [20, 40])
def test_noise_beside_a_faint_line_is_no_second_line(peak):
    """The brightest of 200 bins of noise were told as light beside the line, at a chance of 1e-13."""
    assert _named(laser=lambda p, r: p * peak / 150) == []
