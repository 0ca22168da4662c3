"""A photo that is darker on one side all along: lights or wall cannot be told, and nothing else is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.compare import BLOCK_PX
from stages.twin.dark_side import beside_dark_side, dark_side
from stages.twin.reference import WALL_COLUMNS
from stages.twin.scene import Ring

FRAMES, BLOCKS = 12, (30, 40)
SHAPE = tuple(n * BLOCK_PX for n in BLOCKS)
RING = Ring((SHAPE[1] / 2, SHAPE[0] / 2), 90.0, 50.0, 25.0)
V, U = np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array(SHAPE)[:, None, None] / 2 + 0.5
POLAR = (np.hypot(U, V) / 90).astype(np.float32), np.arctan2(V, U).astype(np.float32), np.ones(SHAPE, bool)
SCENE = SimpleNamespace(polar=POLAR, ring=RING)


def _samples(photo, seed=3, roll_deg=0.0, from_frame=0):
    """Blocks whose photo has a logarithm by azimuth and frame, on wall of blotches as large as a tenth.

    The probe rolls by ``roll_deg`` from a frame to the end.
    """
    theta, phi = (a[4::8, 4::8] for a in POLAR[:2])
    row, column = (np.tile(a, FRAMES) for a in np.nonzero((theta > 0.5) & (theta < 1.5)))
    frame = np.repeat(np.arange(FRAMES), len(row) // FRAMES)
    random, at = np.random.default_rng(seed), phi[row, column]
    blotches = 0.1 * random.standard_normal((FRAMES, 8))[frame, (at * 4 / np.pi).astype(int) % 8]
    light = -1.5 * np.log(theta[row, column])
    rolled = np.clip((frame - from_frame) / (FRAMES - 1 - from_frame), 0, 1)
    turn = (at + np.radians(roll_deg) * rolled) / (2 * np.pi)
    return SimpleNamespace(
        frame=frame, number=8 * np.arange(FRAMES), row=row, column=column, away=theta[row, column],
        around=np.floor(turn % 1 * WALL_COLUMNS).astype(int),
        log_light=light, log_level=4 + light + blotches + photo(at, frame),
    )  # fmt: skip


def _dark(lost, at_rad=0.1):
    return lambda phi, frame: np.log1p(-lost * np.maximum(np.cos(phi - at_rad), 0) ** 2)


def _place(at_deg, name="", fixed_to="image"):
    turn = np.radians(at_deg)
    look = Look(8, 160 + 80 * np.cos(turn), 120 + 80 * np.sin(turn), 20.0)
    return Mismatch(name, "intensity", fixed_to, (), (), 0.0, 2.0, 1.0, "It is 21 % brighter.", look)


@pytest.mark.parametrize("lost", [0.5, 0.9])
def test_a_dark_side_is_stated_and_no_places_at_its_flanks(lost):
    """The photo of a recording with one side dark by 90 % made places at the flanks of that side."""
    found = (_place(-29), _place(36), _place(-29, "window_dirt"), _place(-29, fixed_to="wall"), _place(170))
    kept, told = beside_dark_side(found, (), _samples(_dark(lost)), SCENE)
    assert kept == found[2:]
    side, *withdrawn = told
    assert side.name == ""
    assert side.place[0].value == pytest.approx(np.degrees(0.1), abs=10)
    assert "look the same" in side.statement
    assert len(withdrawn) == 2


@pytest.mark.parametrize(
    ("roll_deg", "from_frame", "alike"), [(6.0, 0, True), (400.0, 0, False), (198.0, FRAMES - 3, True)]
)
def test_wall_is_no_cause_of_a_dark_side_if_the_probe_rolled_by_more_than_half_a_turn(
    roll_deg, from_frame, alike
):
    """Whatever the roll was, the statement was that the probe hardly rolls; then, a turn in the last frames
    sufficed to exclude the wall.
    """
    (side,) = dark_side(_samples(_dark(0.6), roll_deg=roll_deg, from_frame=from_frame), SCENE)
    assert ("look the same" in side.statement) == alike
    stated = float(side.statement.split("°. What" if alike else "°, and")[0].split()[-1])
    assert stated == pytest.approx(roll_deg, abs=2)


@pytest.mark.parametrize(
    "photo",
    [
        lambda phi, frame: 0 * phi,
        lambda phi, frame: 0.1 * np.cos(phi),
        lambda phi, frame: 0.3 * np.cos(2 * phi),
        lambda phi, frame: 0.4 * np.cos(phi - frame),  # wall that is darker now here, now there
    ],
)
def test_a_photo_that_is_even_all_along_has_no_dark_side(photo):
    assert [dark_side(_samples(photo, seed), SCENE) for seed in range(4)] == [()] * 4
    assert beside_dark_side((_place(0),), (), None, SCENE) == ((_place(0),), ())


def test_a_side_that_darkens_during_the_run_is_not_stated_twice():
    at = (NamedFigure("frame_from", 51.0, 2.0), NamedFigure("azimuth_deg", 0.0, 7.0))
    side = Mismatch("", "intensity", "time", at, (), 0.0, 2.0, 1.0, "Darker.")
    assert beside_dark_side((_place(0),), (side,), _samples(_dark(0.9)), SCENE) == ((_place(0),), ())


@pytest.mark.parametrize(("change", "kept"), [(0.3, False), (2.7, True)])
def test_a_place_that_differs_by_more_than_the_dark_side_remains(change, kept):
    """Behind a housing that took .9 of the light, frames differ by 270 % from the photo: withdrawn."""
    place = replace(_place(20), parameters=(NamedFigure("change", change, 0.05),))
    found, _ = beside_dark_side((place,), (), _samples(_dark(0.5)), SCENE)
    assert found == (place,) * kept
