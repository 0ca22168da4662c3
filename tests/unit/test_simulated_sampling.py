"""With more samples a rendered line is nearer to its true place.

One too narrow for its samples is refused.
"""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import UnusableError
from pipeline.simulator.instrument import LineProfile
from pipeline.simulator.premises import require
from pipeline.simulator.premises.check import line_premise, line_px_per_mm
from pipeline.simulator.render import renderer_of
from tests.unit.simulated_pipe import RADIUS, small_truth


def narrow(line_samples):
    """Return a line a third of a pixel wide."""
    truth = small_truth(line_samples)
    laser = replace(truth.instrument.laser, profile=LineProfile(0.2))
    return replace(truth, instrument=replace(truth.instrument, laser=laser))


def crossing_columns(truth):
    """Return the line's centroid, px, along each row that it crosses steeply, right of the middle."""
    light = renderer_of(truth).light(0)[100:200, 260:, 1].astype(float)
    return (light * np.arange(light.shape[1])).sum(1) / light.sum(1)


def test_the_line_converges_with_more_samples():
    best = crossing_columns(narrow(16))
    errors = [np.sqrt(np.mean((crossing_columns(narrow(n)) - best) ** 2)) for n in (1, 2, 4)]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert errors[2] < 0.005


def test_the_scale_of_the_line_is_the_derivative_of_the_lens():
    theta = np.arctan2(RADIUS, 22)
    by_hand = 95 * (1 - 3 * 0.01 * theta**2) * RADIUS / (RADIUS**2 + 22**2)
    assert line_px_per_mm(small_truth()) == pytest.approx(by_hand, rel=1e-4)


def test_a_line_too_narrow_for_its_samples_is_refused():
    with pytest.raises(UnusableError, match="width of the line"):
        require([line_premise(narrow(1))])
    assert line_premise(narrow(3)).holds
