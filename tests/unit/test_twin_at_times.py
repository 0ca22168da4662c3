"""What some frames alone show: a dark spot that moves, and a line that is dim at times."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.instrument.probe import Lighting
from stages.twin.at_times import dark_spots
from stages.twin.causes import causes
from stages.twin.cells import SECTORS, Cells
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring

RING, FRAMES, ROWS, COLUMNS = Ring((400.0, 300.0), 200.0, 50.0, 23.0), 10, 24, 32


def _samples(change, moved=2):
    """Blocks of frames between which the wall moves on by some rows; ``change`` is that of the spot."""
    frame, row, column = np.indices((FRAMES, ROWS, COLUMNS)).reshape(3, -1)
    along = row + moved * frame
    noise = 0.01 * np.random.default_rng(3).standard_normal(frame.size)
    even = np.ones(frame.size)
    return BlockSamples(
        noise + change(frame, row, column, along), 4 * even, even, frame, row, column, along, column,
        0.0, 2.0, 8 * np.arange(FRAMES), even, even,
    )  # fmt: skip


def _at(row, column, middle_row, middle_column):
    return np.where(np.hypot(row - middle_row, column - middle_column) < 2, -0.5, 0.0)


def test_a_dark_spot_that_crawls_is_told_and_one_that_stays_is_not():
    """Nothing was told of it: the photo holds none of it, and it has no place."""
    (spot,) = dark_spots(_samples(lambda f, r, c, a: _at(r, c, 12, 4 + 2.5 * f)))
    assert (spot.name, spot.fixed_to) == ("", "time")
    assert spot.parameters[0].value == pytest.approx(0.5, abs=0.05)
    assert "In 10 of 10 lit frames" in spot.statement
    assert dark_spots(_samples(lambda f, r, c, a: _at(r, c, 12, 16))) == ()
    assert dark_spots(_samples(lambda f, r, c, a: _at(a, c, 16, 16))) == ()
    assert dark_spots(_samples(lambda f, r, c, a: np.zeros(len(f)))) == ()
    assert dark_spots(None) == ()


def test_wall_that_is_dark_at_some_angles_is_not_told_as_something_that_moves():
    """Wet wall, darker than its photo but where it shines, was told as a spot on the window that moves."""

    def wet(f, r, c, a):
        on_wall = (np.abs(a - 20) < 2.5) & (np.abs(c - 16) < 5)
        return on_wall * np.where(np.abs(r - 12) < 4, 0.8, -0.3)

    (spot,) = dark_spots(_samples(wet))
    assert (spot.name, spot.fixed_to) == ("", "image or wall")
    assert "wet or polished" in spot.statement


def test_a_spot_at_one_place_of_some_pictures_is_not_told_as_one_that_moves():
    """In 3 of 10 frames the same blocks were dark, "each time at another place of picture and wall"."""
    (spot,) = dark_spots(_samples(lambda f, r, c, a: np.isin(f, (3, 5, 8)) * _at(r, c, 12, 16)))
    assert (spot.name, spot.fixed_to) == ("", "image")
    assert "another place" not in spot.statement


def test_dark_fragments_in_the_rim_of_a_drop_are_part_of_it():
    """They lay 67 to 82 px from the middle of a drop whose radius was 50 ± 25 px, and were told beside it."""
    disc = _disc(130.0, 100.0, 24.0)
    wide = (*disc[:2], replace(disc[2], sd=12.0))
    drop, unsure = (
        Mismatch("droplet", "intensity", "image", place, (), 0.0, 2.0, 1.0, "") for place in (disc, wide)
    )
    rim = _samples(lambda f, r, c, a: np.isin(f, (3, 5, 8)) * _at(r, c, 17, 16))
    assert [len(dark_spots(rim, (m,))) for m in (drop, unsure)] == [1, 0]


def test_dark_fragments_of_texture_in_a_drop_are_no_spot_that_moves():
    """Beside a drop that was found, a spot was told that moves: each frame has dark fragments elsewhere."""
    drop = Mismatch("droplet", "intensity", "image", _disc(130.0, 100.0, 24.0), (), 0.0, 2.0, 1.0, "It is.")
    turn = 2.4 * np.arange(FRAMES)

    def in_drop(f, r, c, a):
        return _at(r, c, 12 + 2 * np.sin(turn)[f], 16 + 2 * np.cos(turn)[f])

    assert len(dark_spots(_samples(in_drop))) == 1
    assert dark_spots(_samples(in_drop), (drop,)) == ()
    crawls = _samples(lambda f, r, c, a: in_drop(f, r, c, a) + _at(r, c, 20, 4 + 2.5 * f))
    (spot,) = dark_spots(crawls, (drop,))
    assert "In 10 of 10 lit frames" in spot.statement


def _disc(*value):
    names = ("u_px", "v_px", "radius_px")
    return tuple(NamedFigure(n, v, 1.0, "px") for n, v in zip(names, value, strict=True))


@pytest.mark.parametrize(("frames", "told"), [((2, 5, 6, 11), 1), ((5,), 0), (range(14), 0)])
def test_a_line_that_is_dim_at_times_is_told_where_it_is(frames, told):
    """A sector of the laser is dim in all frames: nothing was told of one that some frames show."""
    found = _dim(14, frames, slice(20, 23))
    assert len(found) == told
    for dim in found:
        assert (dim.channel, dim.fixed_to) == ("line", "time")
        assert dim.place[0].value == pytest.approx(35, abs=10)
        assert dim.parameters[0].value == pytest.approx(0.7, abs=0.05)


def test_a_line_that_is_dim_all_round_at_times_or_on_one_side_is_not_told_at_one_place():
    """Each was told at an azimuth of −170 ± 5°, the first of many sectors."""
    (side,) = _dim(40, (6, 17, 29), slice(0, 24))
    assert side.place[0].value == pytest.approx(-60, abs=10)
    assert side.place[1].value == pytest.approx(240, abs=20)
    (whole,) = _dim(40, (6, 17, 29), slice(None))
    assert [p.name for p in whole.place] == ["frame_from", "frame_to"]
    assert "the whole line is about 70 % darker" in whole.statement


def _dim(count, frames, sectors):
    """Return what is told without a name of a line that lost 70 % of its light in frames and sectors."""
    random, number = np.random.default_rng(1), 8 * np.arange(count)
    change = np.zeros((count, SECTORS))
    change[list(frames), sectors] = np.log(0.3)
    own = np.full(change.shape, 200_000.0)
    ratio = np.exp(change + 0.03 * random.standard_normal(change.shape))
    pixels = np.full_like(own, 500.0)
    line = Cells(number, pixels + ratio**2 * own, ratio * own, own, pixels, 20 * pixels)
    return [m for m in causes(None, line, Lighting(), RING)[0] if not m.name]
