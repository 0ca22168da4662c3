"""Landmarks without a view in a window: they move with their surface, and no other is changed."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.adjustment.bordered import landmark_steps
from pipeline.adjustment.rows import LandmarkRows

SEEN, FRAMES, BORDER, OWN = 3, 4, 6, 3


@pytest.mark.parametrize("place", [1, SEEN], ids=["amid the others", "after the others"])
def test_a_landmark_without_views_moves_with_its_surface_only(place: int) -> None:
    """Behind a noise filter the last landmark had no view left: the run ended with a program error."""
    random = np.random.default_rng(3)
    draw, views = random.standard_normal, 2 * SEEN
    start = np.insert(2 * np.arange(SEEN + 1), place, 2 * place)
    marks = LandmarkRows(
        start, np.tile([0, 1], SEEN), draw((views, 2, 6)), draw((views, 2, 3)), draw((views, 2, OWN)),
        draw((views, 2)), np.ones(views), draw((SEEN + 1, 3)), draw((SEEN + 1, BORDER)), draw(SEEN + 1),
        np.ones(SEEN + 1),
    )  # fmt: skip
    frames, border, right = draw((FRAMES, 7)), draw(BORDER), draw((SEEN + 1, 3))
    step = landmark_steps(marks, np.tile(np.eye(3), (SEEN + 1, 1, 1)), right, frames, border)
    surface = (marks.surface_weight * (marks.surface_by_border @ border))[:, None] * marks.surface_by_point
    moved = marks.change_by_view(frames, border) * marks.weight[:, None]
    pull = np.einsum("mij,mi->mj", marks.by_point, moved).reshape(SEEN, 2, 3).sum(1)
    np.testing.assert_allclose(step, right - surface - np.insert(pull, place, 0.0, axis=0))
