"""The law of a spot on the window: what proves it, and the derivatives it is fitted with."""

import numpy as np

from pipeline.artefacts.twin import NamedFigure
from stages.twin.spot import FittedLaw, _slopes_at, _spot_at, fall_of_spot


def test_wall_that_a_few_neighbouring_frames_see_does_not_prove_a_spot():
    size = NamedFigure("share", 0.05, 0.01)
    passing = np.repeat([9.0, 8.0, -1.0, 1.0, 0.5], 3)
    by_turns = passing.reshape(5, 3).T.ravel()
    assert FittedLaw(passing, size).chance > 0.01 > FittedLaw(by_turns, size).chance


def test_dirt_is_proved_by_frames_of_which_some_show_it_many_times_as_clearly():
    """Wet wall is ten times as bright in some frames: dirt of .6 had a chance of 4 %, and no name."""
    random, start = np.random.default_rng(2), np.array([[0.3, 20.0, 20.0, 8.0, 1.0, 0.0]])
    v, u = np.mgrid[0:41, 0:41]
    seen = np.array([1.0, 2.0, 9.0, 30.0, 20.0, 3.0, 1.0])[:, None, None]
    spot = _spot_at(np.array([0.4, 20.0, 20.0, 8.0, 2.0, 0.0]), u, v)
    dirt = seen * (spot + 0.1 * random.standard_normal((7, 41, 41)))
    law = fall_of_spot(np.stack([dirt, seen * np.ones((7, 41, 41))], 1).astype(np.float32), start, 0.0)
    assert FittedLaw(law.fall, law.size).chance > 0.01
    assert law.chance < 1e-4


def test_a_spot_is_fitted_with_its_derivatives():
    u, v = np.mgrid[3:60:7, 4:50:5].reshape(2, -1)
    spot = np.array([0.4, 31.0, 24.0, 12.0, 1.7, 0.02])
    for k, step in enumerate(1e-5 * np.maximum(spot, 1.0)):
        more, less = (_spot_at(spot + way * step * np.eye(6)[k], u, v) for way in (1, -1))
        np.testing.assert_allclose(_slopes_at(spot, u, v)[:, k], (more - less) / (2 * step), atol=1e-6)
    assert np.isfinite(_slopes_at(spot, np.array([31]), np.array([24]))).all()
