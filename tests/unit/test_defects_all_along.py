"""A finding as long as the run is on the wall only if the probe's roll shows it: a drop looks alike.

In a sound pipe a drop's ridge of -.23 mm along the whole run was a deposit at p .98.
"""

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import straight_axis
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.defects import DefectParameters, find_defects
from stages.defects.all_along import may_be_on_window
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording, grey_texture, smooth_noise, wall_of
from tests.unit.dented_rows import AZIMUTH, DISTANCE, RADIUS, SIGMA

if TYPE_CHECKING:
    from stages.defects.parallax import LitPictures

WIDTH = 12


def rolling(roll_rad: float) -> Trajectory:
    """Return the motion of a probe that rolls by so much over the run."""
    k = np.arange(len(DISTANCE))
    turn = np.stack([0.0 * k, 0.0 * k, roll_rad * k / k[-1]], -1)
    T_pc = from_parts(rotation_from_vector(turn), np.stack([0.0 * k, 0.0 * k, DISTANCE], -1))
    axis = straight_axis(-50.0, 200.0)
    return Trajectory(k, k / 30, T_pc, np.zeros((len(k), 6, 6)), axis, RADIUS, 1.0, 0.0, 0.0, ())


def ridge(first: int, last: int, follows_rad: float = 0.0) -> Region:
    """Return a ridge on some rows, which turns on the wall by an angle over the whole run."""
    k = np.arange(first, last)
    column = np.rint(np.degrees(follows_rad * k / (len(DISTANCE) - 1))).astype(int)
    at = column - column.min()
    mask = np.zeros((len(k), int(at.max()) + WIDTH), bool)
    for row, start in zip(mask, at, strict=True):
        row[start : start + WIDTH] = True
    return Region(first, 350 + int(column.min()), mask, -1.0)


@pytest.mark.parametrize(
    ("region", "roll_rad", "expected"),
    [
        (ridge(0, 60), 0.0, True),
        (ridge(2, 58), 0.1, True),
        (ridge(2, 58), 1.0, False),
        (ridge(2, 58), -1.0, False),
        (ridge(2, 58, 1.0), 1.0, True),
        (ridge(10, 50), 0.0, False),
    ],
)
def test_only_roll_tells_a_ridge_along_the_whole_run_from_a_drop(region, roll_rad, expected):
    wall = wall_of(DISTANCE, AZIMUTH, np.full((len(DISTANCE), len(AZIMUTH)), RADIUS), SIGMA)
    relief = smooth_shape_removed(wall.radius_map, DefectParameters())
    assert may_be_on_window(region, relief, cloud_along(wall.cloud), rolling(roll_rad)) == expected


@pytest.mark.parametrize(("roll_rad", "counted"), [(0.0, 0), (1.0, 1)])
def test_such_a_ridge_is_listed_with_the_reason(roll_rad, counted, monkeypatch):
    monkeypatch.setattr("stages.defects.corroborate.shows_drop", lambda *_: False)
    random = np.random.default_rng(5)
    radius = RADIUS + smooth_noise(random, (len(DISTANCE), len(AZIMUTH)), SIGMA, 1.0)
    radius[:, 100 : 100 + WIDTH] -= 0.3
    wall = wall_of(DISTANCE, AZIMUTH, radius, SIGMA)
    no = lambda *_: False  # noqa: E731
    pictures = SimpleNamespace(motion=rolling(roll_rad), drove_through=no, contradict=no)
    told = find_defects(
        bare_recording(2 * RADIUS, None), wall, grey_texture(wall), DefectParameters(), quiet_context(),
        pictures=cast("LitPictures", pictures),
    )  # fmt: skip
    assert (len(told.items), len(told.unconfirmed)) == (counted, 1 - counted)
    assert all("roll the probe" in d.statement and d.probability <= 0.5 for d in told.unconfirmed)
