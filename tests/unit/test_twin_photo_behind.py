"""A spot on the window that has got into the wall's photo, too."""

import numpy as np
import pytest

from pipeline.artefacts.twin import NamedFigure
from stages.twin.compare import BLOCK_PX
from stages.twin.locate import ImagePlace
from stages.twin.photo_behind import without_photo
from stages.twin.reference import BlockSamples

SPOT, TAKES = (20, 30), 0.4
PLACE = ImagePlace(30.5 * BLOCK_PX, 20.5 * BLOCK_PX, 3.0 * BLOCK_PX, -0.3, 0.01, 0.0)


def _samples(in_photo):
    """Return blocks of a wall that moves by four blocks a frame, photographed in part through the spot."""
    random = np.random.default_rng(5)
    frame, row, column = (a.ravel() for a in np.mgrid[0:10, 0:40, 0:60])
    along = row + 4 * frame
    behind = np.hypot(row - SPOT[0], column - SPOT[1]) < 2
    passed_by = np.abs(column - SPOT[1]) < 2
    photo = np.where(passed_by, 1 - in_photo * TAKES, 1.0)
    change = np.where(behind, 1 - TAKES, 1.0) / photo - 1 + 0.005 * random.standard_normal(len(row))
    flat = 0 * change
    return BlockSamples(
        change, flat, 1 + flat, frame, row, column, along, column, 0.0, 2.5, np.arange(10), flat, flat
    )


@pytest.mark.parametrize("in_photo", [0.0, 0.35, 0.7])
def test_the_light_that_a_spot_takes_is_told_whatever_of_it_is_in_the_photo(in_photo):
    seen = NamedFigure("share", 1 - (1 - TAKES) / (1 - in_photo * TAKES), 0.005)
    freed = without_photo(seen, PLACE, _samples(in_photo))
    assert freed.value == pytest.approx(TAKES, abs=0.01)
    assert 0.005 < freed.sd < 0.02


def test_where_no_frame_shows_the_wall_beside_the_spot_the_share_stays_as_seen():
    seen = NamedFigure("share", 0.3, 0.01)
    assert without_photo(seen, PLACE, None) == seen
