"""Pictures shown once more are told by how little they change, whatever their exposures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stages.premises.pictures import change_between


def test_pictures_exposed_alike_by_chance_are_no_copies() -> None:
    """The wall goes on in both, in one at 1.4 times the light; a copy hardly changes, whatever its light."""
    random = np.random.default_rng(2)
    wall = cv2.GaussianBlur(random.uniform(40, 160, (80, 240)).astype(np.float32), (0, 0), 2)
    moved = np.roll(wall, 3, 0)
    assert change_between(wall, 1.4 * moved) == pytest.approx(change_between(wall, moved), rel=0.2)
    assert change_between(1.4 * moved, wall) == pytest.approx(change_between(wall, 1.4 * moved), rel=1e-5)
    copy = 1.4 * wall + random.normal(0, 1, wall.shape).astype(np.float32)
    assert change_between(wall, copy) < 0.25 * change_between(wall, moved)
    assert change_between(np.zeros_like(wall), wall) == pytest.approx(wall.mean(), rel=1e-5)
