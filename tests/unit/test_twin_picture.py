"""Laws of whole pictures, on synthetic pictures: named where they act, and nowhere else."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from stages.twin.gate import judged
from stages.twin.lamp_light import Figure
from stages.twin.name import focus_of
from stages.twin.picture import WholePictures
from stages.twin.render import Region
from stages.twin.switched import Shown, leaked
from tests.unit.whole_pictures import (
    AWAY,
    LINE_LIGHT,
    PHI,
    SCENE,
    SHAPE,
    WHITE,
    U,
    V,
    found_in,
    line_of_laser,
    named,
    noisy,
    twin_of,
)


def _moved(picture, random):
    angle = random.uniform(0, np.pi)
    steps = [
        np.float32([[1, 0, d * np.cos(angle)], [0, 1, d * np.sin(angle)]]) for d in np.linspace(-3, 3, 9)
    ]
    return np.mean([cv2.warpAffine(picture, m, SHAPE[::-1], borderMode=cv2.BORDER_REFLECT) for m in steps], 0)


def _bloomed(picture, random):
    spots = (((U - u) / 12) ** 2 + ((V - v) / 8) ** 2 for u, v in ((160, 50), (250, 120)))
    spot = sum(300 * np.exp(-0.5 * away) for away in spots)
    over = np.maximum(picture + spot - WHITE, 0).astype(np.float32)
    tail = np.exp(-np.abs(np.arange(-40, 41)) / 6.0)
    leaked = cv2.sepFilter2D(over, -1, np.ones(1), tail / tail.sum())
    return np.where(over > 0, WHITE + 50, picture + leaked)


def _clipped(picture, random):
    return np.where(np.hypot(U - 160, V - 50) < 15, WHITE + 50, picture)


def test_with_noise_alone_nothing_is_named():
    assert named() == []
    assert named(_clipped) == []


def test_motion_blur_is_distinguished_from_defocus():
    assert named(_moved) == ["motion_blur"]
    assert named(lambda p, r: cv2.GaussianBlur(p, (0, 0), 2), of_sharpness=2.0) == ["defocus"]


@pytest.mark.parametrize(("way", "name"), [(3, "defocus or motion_blur"), (1, "motion_blur")])
def test_blur_along_the_pipe_may_be_a_lens_out_of_focus_seen_more_obliquely_than_in_the_photo(way, name):
    """Frames blurred alike in all directions were told to move, and nothing else, by 2.1 ± .4 px."""
    whole, blurs = WholePictures(SCENE), np.zeros((8, 2, 4))
    blurs[:, :, way] = 2.0 + 0.1 * np.random.default_rng(3).standard_normal((8, 2))
    whole.blur, whole.kept, whole.frame["blur"] = [None] * 8, [0.5] * 8, list(range(8))
    whole._blurs = lambda: blurs
    suspected = whole._motion_blur(np.zeros(4))
    assert suspected.mismatch.name == name
    assert ("at rest" in suspected.mismatch.statement) == (way == 3)


def test_a_name_that_frames_rendered_again_do_not_confirm_is_withdrawn():
    for change, name in (
        (_moved, "motion_blur"),
        (lambda p, r: 100 * (p / 100) ** 0.7, "response"),
        (lambda p, r: cv2.GaussianBlur(p, (0, 0), 2), "defocus"),
    ):
        blur = 2.0 if name == "defocus" else 0.0
        kept, withdrawn = found_in(change, of_sharpness=blur, judge=noisy)
        assert not kept
        assert withdrawn[0].name == name


def _ring(width):
    return (150 / width * np.exp(-0.5 * ((AWAY - 70) / width) ** 2)).astype(np.float32)


@pytest.mark.parametrize(("recorded", "stands"), [(2.4, True), (1.2, False)])
def test_a_wide_line_is_kept_if_recorded_frames_fit_no_line_of_a_focused_lens(recorded, stands):
    random, region = np.random.default_rng(3), np.where(abs(AWAY - 70) < 9, Region.LINE_CORE, Region.DARK)
    line = SimpleNamespace(blur_px=Figure(2.4, 0.1))
    whole = SimpleNamespace(frames_of=lambda law: np.arange(8), scene=SCENE)
    (suspected,) = focus_of(SimpleNamespace(line=line, sharpness=np.zeros(4)), _blind(whole), ())
    both = SimpleNamespace(**vars(whole), frame={"blur": np.arange(8)})
    both.even_blur, both.loses_texture = lambda sharpness: np.full(8, 2.0), True
    assert len(focus_of(SimpleNamespace(line=line, sharpness=np.zeros(4)), both, ())) == 2

    def again(line):
        return _ring(line(LINE_LIGHT).blur_px.value)

    wide = twin_of(_ring(2.4), region)
    seen = [noisy(_ring(recorded), random) for _ in range(8)]
    shown = [(f, Shown(s, wide, AWAY > 0, SCENE, again, None, None)) for f, s in enumerate(seen)]
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

    assert named(displaced) == []


@pytest.mark.parametrize("power", [0.7, 1.3])
def test_a_response_is_named_and_light_that_falls_off_is_not(power):
    assert named(lambda p, r: 100 * (p / 100) ** power) == ["response"]
    assert named(lambda p, r: p * (1 - 0.3 * (AWAY / 200) ** 2)) == []


def test_a_photo_with_internal_displacements_is_not_a_response():
    def torn(picture, random):
        shift = [
            cv2.GaussianBlur(random.standard_normal(SHAPE).astype(np.float32), (0, 0), 4) for _ in range(2)
        ]
        at = [(a + 3 * s / s.std()).astype(np.float32) for a, s in zip((U, V), shift, strict=True)]
        return cv2.remap(picture, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)

    assert named(torn) == []


def test_bloom_is_found_along_columns_only():
    (bloom,), _ = found_in(_bloomed)
    (leak,) = bloom.parameters
    # Its σ was that from frame to frame, ± .005 beside a true .26, though its reach is only assumed.
    assert (bloom.name, leak.sd) == ("bloom", np.inf)
    assert "If it fades to 1/e over 6 px" in bloom.statement


@pytest.mark.parametrize("at", [(1.3,), (1.3, 0.2), (0.2,)])
def test_wet_streaks_along_the_pipe_that_clip_are_no_bloom(at):
    """Streaks below the probe, which shone along the pipe, were "bloom of 52 % of full scale"."""

    def wet(picture, random):
        shine = sum(np.exp(-0.5 * ((PHI - a) * AWAY / 5) ** 2 - ((AWAY - 90) / 25) ** 2) for a in at)
        return picture + 400 * shine

    assert "bloom" not in named(wet)


@pytest.mark.parametrize("leak", [0.0, 40.0])
def test_bloom_of_a_clipped_line_is_measured_beside_it_and_not_on_its_profile(leak):
    """A line wider on some sides than its twin hid bloom of 11 %: the leak was measured on the line, too."""
    random, whole = np.random.default_rng(7), WholePictures(SCENE)
    for frame in range(8):
        twin = line_of_laser()
        wider = 60 * np.cos(2 * PHI + frame) * np.exp(-0.5 * ((abs(AWAY - 70) - 4) / 1.5) ** 2)
        full = twin.level > 140
        seen = twin.level + wider + leak * leaked(~full)[0]
        seen = np.where(full, WHITE + 50, np.minimum(noisy(seen, random), WHITE - 1)).astype(np.float32)
        whole.add_clipped(frame, seen, twin, ~full)
    assert (whole._bloom() is not None) == (leak > 0)
