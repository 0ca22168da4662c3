"""Dirt and drops on the window.

They are found at their place and named by the law that frames confirm, on synthetic pictures.
"""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.blocks import block_textures
from stages.twin.locate import ImagePlace, full_size, places_displaced, without_duplicates
from stages.twin.render import Region, TwinFrame
from stages.twin.spot import FittedLaw
from stages.twin.window import WindowPlace, _fall_of_drop, _with_photo, or_on_window, separated_from_blur


def _frame(level):
    unknown, even = (np.full(level.shape, x, np.float32) for x in (np.nan, 4.0))
    return TwinFrame(level, even, np.full(level.shape, Region.WALL, np.uint8), unknown, unknown)


def _textured(random):
    fine = cv2.GaussianBlur(random.standard_normal((200, 240)).astype(np.float32), (0, 0), 2.0)
    return (90 + 25 * fine / fine.std()).astype(np.float32)


def _dirty_picture(level, name):
    v, u = np.mgrid[0:200, 0:240].astype(np.float32)
    near = np.exp(-0.5 * ((u - 120) ** 2 + (v - 100) ** 2) / 13**2)
    if name == "window_dirt":
        return level * (1 - 0.3 * near)
    if name == "window_scatter":
        return (1 - 0.6 * near) * level + 0.6 * near * cv2.blur(level, (61, 61))
    square = np.minimum(((u - 120) ** 2 + (v - 100) ** 2) / 25**2, 1)
    seen = [(m + (x - m) * (1 - 1.4 * (1 - square))).astype(np.float32) for x, m in ((u, 120), (v, 100))]
    return cv2.remap(level, *seen, cv2.INTER_LINEAR) if name else level


@pytest.mark.parametrize("name", ["window_dirt", "window_scatter", "droplet", ""])
def test_effects_on_the_window_are_confirmed_by_frames_or_withdrawn(name):
    random = np.random.default_rng(3)
    place = WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6))
    for frame in range(9):
        level = _textured(random)
        recorded = _dirty_picture(level, name) + 2 * random.standard_normal(level.shape)
        place.add(frame, recorded.astype(np.float32), _frame(level), np.ones(level.shape, bool))
    found = place.judged("image")
    assert place.judged("wall") is None
    if not name:
        assert found is None
        return
    assert found is not None
    assert found.name == name
    assert found.chi2_after < found.chi2_before


def test_dirt_is_named_beside_wall_that_is_not_known():
    """A speck near the border of the view was no dirt: within twice its radius wall had to be known."""
    random = np.random.default_rng(3)
    place = WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6))
    for frame in range(9):
        level = _textured(random)
        recorded = _dirty_picture(level, "window_dirt") + 2 * random.standard_normal(level.shape)
        twin = _frame(level)
        twin.region[:, :108] = Region.EDGE
        place.add(frame, recorded.astype(np.float32), twin, np.ones(level.shape, bool))
    assert place.judged("image").name == "window_dirt"


def test_texture_with_more_contrast_than_the_photo_is_not_scatter():
    random = np.random.default_rng(3)
    place = WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6))
    for frame in range(9):
        level = _textured(random)
        recorded = level + 2 * random.standard_normal(level.shape)
        scattered = _dirty_picture(level, "window_scatter").astype(np.float32)
        place.add(frame, recorded.astype(np.float32), _frame(scattered), np.ones(level.shape, bool))
    found = place.judged("image")
    assert found.name == ""
    assert "stronger" in found.statement


@pytest.mark.parametrize(
    ("share", "sd", "told"),
    [
        (0.06, 0.01, True),
        (0.06, 0.05, False),
        (0.06, 0.022, False),
        (0.045, 0.01, False),
        (0.02, 0.001, False),
    ],
)
def test_a_share_that_may_be_zero_is_not_reported(share, sd, told, monkeypatch):
    law = FittedLaw(np.linspace(9, 11, 9), NamedFigure("share", share, sd))
    monkeypatch.setattr("stages.twin.window.fall_of_spot", lambda *_: law)
    random, place = np.random.default_rng(3), WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6))
    for frame in range(9):
        level = _textured(random)
        place.add(frame, level, _frame(level), np.ones(level.shape, bool))
    assert (place.judged("image") is not None) == told


@pytest.mark.parametrize(("share", "name"), [(0.9, "window_scatter or window_dirt"), (1.74, "window_dirt")])
def test_scatter_of_more_than_all_light_is_not_scatter(share, name, monkeypatch):
    """A thin, dark scratch was scatter of 174 ± 14 % of the light, or else dirt."""
    scatter = FittedLaw(np.linspace(9, 11, 9), NamedFigure("share", share, 0.14))
    dirt = FittedLaw(np.linspace(11, 8, 9), NamedFigure("share", 0.3, 0.02))
    monkeypatch.setattr("stages.twin.window.fall_of_spot", lambda *of: scatter if of[2] else dirt)
    random, place = np.random.default_rng(3), WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6))
    for frame in range(9):
        level = _textured(random)
        place.add(frame, level, _frame(level), np.ones(level.shape, bool))
    found = place.judged("image")
    assert found.name == name
    assert "takes away" in found.statement


@pytest.mark.parametrize("texture", [1.0, 0.92, 1.06])
def test_scatter_is_found_whatever_the_texture_of_the_photo(texture):
    random = np.random.default_rng(3)
    place = WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6))
    for frame in range(9):
        level = _textured(random)
        recorded = _dirty_picture(level, "window_scatter") + 2 * random.standard_normal(level.shape)
        photo = (90 + texture * (level - 90)).astype(np.float32)
        place.add(frame, recorded.astype(np.float32), _frame(photo), np.ones(level.shape, bool))
    share, brighter = place.judged("image").parameters
    assert share.value == pytest.approx(0.6, abs=max(0.02, 2 * share.sd))
    assert max(share.sd, abs(brighter.value)) < 0.04


@pytest.mark.parametrize(("drawn_px", "seen_radii"), [(3.0, 9.0), (3.0, 1.2), (0.0, 9.0)])
def test_a_weak_drop_is_found_by_the_displacement_of_texture_and_named(drawn_px, seen_radii):
    """At the border of the view too little wall was lit two radii about a drop, and it had no name."""
    random, shifts = np.random.default_rng(3), []
    v, u = np.mgrid[0:200, 0:240].astype(np.float32)
    away = np.hypot(u - 70, v - 130) / 20
    aside = drawn_px * np.exp(0.5 - 0.5 * away**2)  # at most, 20 px from its middle
    seen = [(x + aside * (x - m) / 20).astype(np.float32) for x, m in ((u, 70), (v, 130))]
    pictures = []
    for _ in range(6):
        level = _textured(random)
        drawn = cv2.remap(level, *seen, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        pictures.append((level, (drawn + random.standard_normal(level.shape)).astype(np.float32)))
        shifts.append(block_textures(pictures[-1][1], _frame(level), 1e9)[1])
    found, aside = places_displaced(shifts)
    assert len(found) == (drawn_px > 0)
    if not drawn_px:
        return
    assert np.hypot(found[0].u_px - 70, found[0].v_px - 130) < 8
    assert 20 < found[0].radius_px < 70
    whole = np.stack([full_size(a, level.shape, 0.0) for a in aside])
    place = WindowPlace(found[0], aside_px=found[0].most_of(whole))
    lit = np.hypot(u - found[0].u_px, v - found[0].v_px) < seen_radii * found[0].radius_px
    for frame, (level, recorded) in enumerate(pictures):
        twin = _frame(level)
        twin = replace(twin, region=np.where(lit, twin.region, np.uint8(Region.DARK)))
        place.add(frame, recorded, twin, np.ones(level.shape, bool), twin.drawn_aside(whole).level)
    named = place.judged("image")
    assert named.name == "droplet"
    assert named.parameters[0].name == "aside"
    assert 1 < named.parameters[0].value < 4


@pytest.mark.parametrize(("aside_px", "bends"), [(0.46, False), (1.5, True)])
def test_texture_displaced_by_less_than_its_error_is_not_a_drop(aside_px, bends):
    """Errors of radii, from an unstated tilt of the laser sheet, displace texture by .4 px in places."""
    random, aside = np.random.default_rng(7), np.zeros((2, 200, 240), np.float32)
    aside[0, 110:150, 50:90] = aside_px
    place = WindowPlace(ImagePlace(70.0, 130.0, 20.0, 0.0, 0.1, 1e-4), aside_px=aside_px)
    for frame in range(6):
        level = _textured(random)
        drawn = _frame(level).drawn_aside(aside).level
        recorded = (drawn + random.standard_normal(level.shape)).astype(np.float32)
        place.add(frame, recorded, _frame(level), np.ones(level.shape, bool), drawn)
    named = place.judged("image")
    assert (named is not None and named.name == "droplet") == bends


def test_dirt_that_a_drop_explains_only_in_part_is_not_a_drop():
    """The photo contains a part of what is on the window: a drop would amplify it, as frames do."""
    random = np.random.default_rng(3)
    place = WindowPlace(ImagePlace(120.0, 100.0, 12.0, -0.5, 0.02, 1e-6), aside_px=1.25)
    v, u = np.mgrid[0:200, 0:240].astype(np.float32)
    spot = np.exp(-0.5 * (((u - 120) ** 2 + (v - 100) ** 2) / 10**2) ** 2)
    for frame in range(9):
        clean = 90 + 0.15 * (_textured(random) - 90)
        recorded = clean * (1 - 0.5 * spot) + 2 * random.standard_normal(clean.shape)
        photo = _frame((clean * (1 - 0.25 * spot)).astype(np.float32))
        place.add(frame, recorded.astype(np.float32), photo, np.ones(clean.shape, bool))
    assert _fall_of_drop(np.stack(place.drops), 1.25).chance < 0.01
    assert place.judged("image").name == "window_dirt"


@pytest.mark.parametrize(
    ("dirt", "name"),
    [
        ((30, 31, 29, 30, 32, 30, 31, 29, 30), "window_dirt"),
        ((90, 1, 2, 0, 80, 1, 3, 0, 2), "droplet or window_dirt"),
        ((1, 2, 0, 1, 2, 1, 0, 2, 1), "droplet"),
    ],
)
def test_a_drop_is_kept_beside_dirt_that_fits_better_but_not_surely(dirt, name, monkeypatch):
    dirt_falls = FittedLaw(np.array(dirt, float), NamedFigure("share", 0.5, 0.01))
    no_scatter = FittedLaw(np.full(9, -5.0), NamedFigure("share", 0.0, 0.01))
    drop = FittedLaw(np.linspace(9, 11, 9), NamedFigure("aside", 1.25, 0.5), np.linspace(0.9, 1.1, 9))
    laws = iter((dirt_falls, no_scatter))
    monkeypatch.setattr("stages.twin.window.fall_of_spot", lambda *_: next(laws))
    monkeypatch.setattr("stages.twin.window._fall_of_drop", lambda *_: drop)
    random = np.random.default_rng(3)
    place = WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6), aside_px=1.25)
    for frame in range(9):
        level = _textured(random)
        place.add(frame, level, _frame(level), np.ones(level.shape, bool), level)
    assert place.judged("image").name == name


def test_faint_texture_is_found_where_brightness_is_uniform():
    random = np.random.default_rng(3)
    shares = []
    for _ in range(6):
        level = _textured(random)
        recorded = _dirty_picture(level, "window_scatter") + random.standard_normal(level.shape)
        shares.append(block_textures(recorded.astype(np.float32), _frame(level), 1e9)[0])
    share = np.nanmedian(shares, axis=0)
    assert share[12, 14] < 0.7
    assert share[3, 3] == pytest.approx(1, abs=0.1)


def test_one_spot_is_reported_once_and_two_are_reported_twice():
    def spot(u, fall):
        place = tuple(
            NamedFigure(n, v, 4.0, "px") for n, v in (("u_px", u), ("v_px", 50.0), ("radius_px", 9.0))
        )
        return Mismatch("window_scatter", "intensity", "image", place, (), 0.0, 5.0, 5.0 - fall, "")

    told = without_duplicates([spot(100, 1.0), spot(112, 3.0), spot(300, 2.0)])
    assert [m.place[0].value for m in told] == [112, 300]


@pytest.mark.parametrize("flatness", [1.0, 2.0])
def test_the_size_of_a_spot_is_right_for_any_shape_of_its_rim(flatness):
    random = np.random.default_rng(5)
    place = WindowPlace(ImagePlace(124.0, 97.0, 16.0, -0.3, 0.02, 1e-6))
    v, u = np.mgrid[0:200, 0:240].astype(np.float32)
    spot = 0.3 * np.exp(-0.5 * (((u - 120) ** 2 + (v - 100) ** 2) / 14**2) ** flatness)
    for frame in range(9):
        level = _textured(random)
        recorded = level * (1 - spot) + 2 * random.standard_normal(level.shape)
        place.add(frame, recorded.astype(np.float32), _frame(level), np.ones(level.shape, bool))
    found = place.judged("image")
    assert found.name == "window_dirt"
    (share,) = found.parameters
    assert share.value == pytest.approx(0.3, abs=0.015)
    # The photo may be darker by the dirt, too, but by no more than in frames beyond the photo.
    in_photo = 0.3 * random.uniform(0, 1, 4000)
    away = np.abs(1 - (1 - 0.3) * (1 - in_photo) - share.value)
    assert np.mean(away < 2 * share.sd) > 0.99
    assert np.mean(away < share.sd) == pytest.approx(1 / np.sqrt(3), abs=0.07)  # of a uniform error


@pytest.mark.parametrize("share", [-0.2, 1.2])
def test_a_photo_cannot_contain_a_share_of_a_zero_effect(share):
    assert _with_photo(NamedFigure("share", share, 0.04)).sd == pytest.approx(0.04)


def test_a_dim_sector_may_always_be_on_the_window():
    """Scatter across the line was called a sector of the laser: lit frames showed nothing of it."""
    at, other = (NamedFigure("azimuth_deg", -100.0, 3.0),), (np.nan, np.nan, np.nan, "", None)
    sectors = [
        Mismatch(n, "line", "line", at, (), *other) for n in ("laser_sector", "laser_sector or laser_step")
    ]
    step = Mismatch("laser_step", "line", "time", (NamedFigure("frame_from", 9.0, 1.0),), (), *other)
    told = or_on_window((*sectors, step))
    more = " or window_dirt or window_scatter"
    assert [m.name for m in told] == [*(s.name + more for s in sectors), "laser_step"]
    assert "window" in told[0].statement


def test_scatter_is_withdrawn_where_whole_frames_are_blurred():
    def named(name):
        return Mismatch(name, "intensity", "image", (), (), 1e-5, 2.0, 1.0, "Something is there.")

    spots = [named("window_dirt"), named("window_scatter or window_dirt"), named("droplet")]
    kept, withdrawn = separated_from_blur(spots, [named("motion_blur")])
    assert [m.name for m in kept] == ["window_dirt", "droplet"]
    assert [m.name for m in withdrawn] == ["window_scatter or window_dirt"]
    assert "blurred" in withdrawn[0].statement
    assert separated_from_blur(spots, [named("bloom")]) == (tuple(spots), ())
    line = replace(named("defocus or thick_sheet"), channel="line")
    assert separated_from_blur(spots, [line]) == (tuple(spots), ())
