"""Tests of pictures before and after rendering: dark borders, dark recordings."""

import numpy as np

from pipeline.simulator.premises import check
from tests.unit.simulated_pipe import small_truth


def test_beyond_its_edge_a_picture_is_dark_whatever_was_in_memory():
    truth = small_truth()
    black = np.zeros((300, 400, 3), np.uint8)
    # memory of the size that is requested next, every other block freed again
    held = [np.full((360, 250, 3), 255, np.uint8) for _ in range(200)]
    del held[::2]
    for _ in range(20):
        assert check._peaks(truth, black).max() == 0


def test_a_dark_recording_is_refused_with_advice():
    truth = small_truth()
    premises = check.picture_premises(truth, {n: np.zeros((300, 400, 3), np.uint8) for n in (0, 1)})
    broken = {p.name: p.hint for p in premises if not p.holds}
    assert "laser.peak" in broken["azimuths at which the line is seen"]
    assert "light.level" in broken["median grey of the lit wall"]
