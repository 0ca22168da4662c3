"""Places in the image that dirt on the window darkens, and what is not taken for dirt."""

import cv2
import numpy as np
import pytest

from pipeline.artefacts.twin import NamedFigure
from stages.twin.compare import BLOCK_PX
from stages.twin.locate import ImagePlace, full_size, places_in_image
from stages.twin.reference import BlockSamples, in_image
from stages.twin.render import Region, TwinFrame
from stages.twin.spot import FittedLaw
from stages.twin.unexplained import unexplained
from stages.twin.window import WindowPlace, _fall_of_drop


def _ratios(random, spot=None, frames=8):
    shape = (75, 100)
    v, u = np.mgrid[0 : shape[0], 0 : shape[1]]
    fixed = 1 + 0.002 * random.standard_normal(shape)
    if spot is not None:
        fixed -= spot[2] * np.exp(-0.5 * ((u - spot[0]) ** 2 + (v - spot[1]) ** 2) / 2.0**2)
    return [(fixed + 0.004 * random.standard_normal(shape)).astype(np.float32) for _ in range(frames)]


def test_clean_windows_show_no_dirt():
    found = [places_in_image(_ratios(np.random.default_rng(k))) for k in range(30)]
    assert [len(places) for places, _ in found] == [0] * 30


def test_dirt_is_found_at_its_place():
    (place,), gain = places_in_image(_ratios(np.random.default_rng(3), (40, 30, 0.3)))
    middle = (np.array([40, 30]) + 0.5) * BLOCK_PX - 0.5
    assert np.hypot(place.u_px - middle[0], place.v_px - middle[1]) < BLOCK_PX
    assert place.change == pytest.approx(-0.3, abs=0.02)
    assert place.probability < 1e-6
    whole = full_size(gain, (600, 800))
    assert whole.shape == (600, 800)
    assert whole.min() == pytest.approx(0.7, abs=0.03)
    assert np.median(whole) == 1


def test_dirt_that_the_photo_holds_too_is_found_at_its_own_place():
    """Dark dirt and wall beside it, which is brighter than its photo, were one place, 28 px off the dirt."""
    bright = sum(_spot(u, 30, 0.2) for u in (32, 33, 34))
    places, _ = places_in_image([r + bright for r in _ratios(np.random.default_rng(3), (40, 30, 0.3))])
    assert [p.change < 0 for p in places] == [True, False]
    middle = (np.array([40, 30]) + 0.5) * BLOCK_PX - 0.5
    assert np.hypot(places[0].u_px - middle[0], places[0].v_px - middle[1]) < BLOCK_PX


def _spot(column, row, size):
    v, u = np.mgrid[0:75, 0:100]
    return (size * np.exp(-0.5 * ((u - column) ** 2 + (v - row) ** 2) / 2.0**2)).astype(np.float32)


def test_wall_that_differs_from_frame_to_frame_is_not_dirt():
    random, ratios = np.random.default_rng(6), _ratios(np.random.default_rng(3))
    assert len(ratios) < 20
    wall = np.zeros(ratios[0].shape, np.float32)
    wall[30:33, 40:43] = 1
    differs = np.linspace(-0.16, 0.04, len(ratios))  # like corroded wall that moved past: -6 % in the mean
    random.shuffle(differs)
    assert not places_in_image([r + np.float32(d) * wall for r, d in zip(ratios, differs, strict=True)])[0]
    assert places_in_image([r - np.float32(0.06) * wall for r in ratios])[0]


def test_a_poor_photo_far_ahead_is_not_dirt():
    random = np.random.default_rng(4)
    ratios = _ratios(random, (80, 30, 0.4))
    v, u = np.mgrid[0:75, 0:100]
    far = np.hypot(v - 37, u - 49.5)
    poor = np.where(far < 8, 0.1 * np.sin(0.7 * (u + 2 * v)), 0)
    (place,), _ = places_in_image([r + poor.astype(np.float32) for r in ratios])
    assert place.u_px == pytest.approx(80.5 * BLOCK_PX, abs=BLOCK_PX)


@pytest.mark.parametrize(
    ("shown", "told"), [((0.6, 1.0, 0.9, 0.8, 0.6), True), ((0.4, -0.4, 0.6, 0, 0.1), False)]
)
def test_a_drop_is_confirmed_by_frames_that_show_it_as_predicted_however_much_each_varies(shown, told):
    """Texture that a drop displaces differs from frame to frame, and so do the decreases of χ²."""
    own = np.array([23e3, 320e3, 180e3, 14e3, 7e3])
    sums = np.stack([own * np.array(shown), own], 1)[..., None]
    assert (_fall_of_drop(sums, 1.5).chance < 0.01) == told


def test_a_ring_that_no_lamp_of_the_twin_lights_is_not_dirt():
    """Light reflected from wall to wall, beyond that of the lamps, was listed as 21 window places."""
    random = np.random.default_rng(4)
    v, u = np.mgrid[0:75, 0:100]
    ring = np.abs(np.hypot(v - 37, u - 49.5) - 24.5) < 1
    bounced = ring * (0.35 + 0.1 * random.standard_normal(ring.shape))
    ratios = [r + bounced.astype(np.float32) for r in _ratios(random, (80, 30, 0.4))]
    (place,), _ = places_in_image(ratios)
    assert place.u_px == pytest.approx(80.5 * BLOCK_PX, abs=BLOCK_PX)


def _blocks(change, frames=10):
    """Blocks of frames whose wall moves by two rows a frame, with a change by row, column and wall."""
    random = np.random.default_rng(6)
    frame, row, column = (a.ravel() for a in np.mgrid[0:frames, 0:40, 0:60])
    along = row + 2 * frame
    value = 0.01 * random.standard_normal(len(frame)) + change(row, column, along)
    return BlockSamples(
        value, 4 + 0 * value, 32 + 0 * value, frame, row, column, along, column, 100.0, 2.5,
        np.arange(frames), row / 40, 0 * value,
    )  # fmt: skip


def test_a_place_that_no_effect_on_the_window_explains_is_reported_without_a_name():
    """Shade behind which the photo was a tenth was corrected (chi-square 47 to 7) and not mentioned."""
    place = ImagePlace(20.5 * BLOCK_PX, 20.5 * BLOCK_PX, 24.0, 1.4, 0.01, 0.0)
    uneven = _blocks(lambda r, c, s: np.where(np.hypot(r - 20, c - 20) < 4, np.where(c > 20, 3.0, -0.5), 0))
    found = unexplained(place, uneven)
    assert (found.name, found.fixed_to) == ("", "image")
    assert found.parameters[0].value == pytest.approx(np.sqrt((9 + 0.25) / 2), abs=0.4)
    assert unexplained(place, _blocks(lambda r, c, s: 0 * r)) is None
    assert unexplained(place, None) is None
    by_wall = _blocks(lambda r, c, s: 0.3 * (np.abs(s - 22) < 2))
    assert in_image(by_wall, (place,)) != ("image",)


@pytest.mark.parametrize(("places", "told"), [(1, True), (8, False)])
def test_chance_has_as_many_opportunities_as_places_are_tried(places, told, monkeypatch):
    """One of eight places of wet steel was a drop at a chance of .0007 for one effect at one place."""
    law = FittedLaw(np.array([1.0, 5, 2, 4, 3, 6, 0.5, 7, 1.5]), NamedFigure("share", 0.3, 0.01))
    assert 1e-4 < law.chance < 0.003
    monkeypatch.setattr("stages.twin.window.fall_of_spot", lambda *_: law)
    place, shape = WindowPlace(ImagePlace(120.0, 100.0, 18.0, -0.3, 0.02, 1e-6)), (200, 240)
    level, nowhere = np.full(shape, 90, np.float32), np.full(shape, np.nan, np.float32)
    even, region = np.full(shape, 4, np.float32), np.full(shape, Region.WALL, np.uint8)
    for frame in range(9):
        place.add(frame, level, TwinFrame(level, even, region, nowhere, nowhere), np.ones(shape, bool))
    assert (place.judged("image", places) is not None) == told


@pytest.mark.parametrize("shines", [True, False])
def test_light_that_stays_in_the_image_is_no_drop(shines):
    """In wet steel, three places that mirrored the lamps were drops: their light seemed displaced."""
    random, made = np.random.default_rng(3), []
    place = WindowPlace(ImagePlace(120.0, 100.0, 14.0, 0.3, 0.02, 1e-6), aside_px=3.0)
    v, u = np.mgrid[0:200, 0:240].astype(np.float32)

    def streak(at):
        return np.exp(-0.5 * ((u - at) / 3) ** 2 - 0.5 * ((v - 100) / 9) ** 2)

    for frame in range(8):
        fine = cv2.GaussianBlur(random.standard_normal(u.shape).astype(np.float32), (0, 0), 2.0)
        wall = 90 + 10 * fine / fine.std()
        moved = cv2.remap(wall, u + 3, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        twin = wall + 20 * (streak(115) - streak(129)) * shines
        drawn = wall + 20 * (streak(112) - streak(126)) if shines else moved
        recorded = wall + 50 * (streak(110) - streak(124)) if shines else moved
        recorded = (recorded + random.standard_normal(u.shape)).astype(np.float32)
        nowhere, even = np.full_like(u, np.nan), np.full_like(u, 4.0)
        region = np.full(u.shape, Region.WALL, np.uint8)
        shown = TwinFrame(twin.astype(np.float32), even, region, nowhere, nowhere)
        place.add(frame, recorded, shown, np.ones(u.shape, bool), drawn.astype(np.float32))
        made.append(place.drops[-1])
    assert _fall_of_drop(np.stack(made), 3.0).chance < 0.01
    told = place.judged("image")
    assert (told is not None and "droplet" in told.names) == (not shines)
