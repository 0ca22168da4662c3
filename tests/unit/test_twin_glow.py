"""Light on the wall of laser frames that comes and goes is told with its frames, mean and σ."""

import numpy as np
import pytest

from stages.twin.glow import LIGHT, glow
from stages.twin.scene import Ring

RING = Ring((160.0, 120.0), 70.0, 50.0, 25.0)


def test_light_that_comes_during_the_run_is_told_with_its_frames():
    """Lamps that stay on from the middle of the run on were a laser that gains 167 %, and nothing else."""

    def found(wall):
        return glow([np.array([[0, 1, 0, 0, w]] * 3) for w in wall], np.arange(0, 8 * len(wall), 8), RING)

    light = found([0.1, 0.0, -0.1, 16.0, 17.0, 16.5]).mismatch
    assert [p.value for p in light.place] == [24, 40]
    assert light.parameters[0].value == pytest.approx(16.5)
    assert (light.name, found([0.6] * 6), found([np.nan] * 6)) == (LIGHT, None, None)
    assert found([0.0, 9.0, 9.0, np.nan]) is None


@pytest.mark.parametrize(("mean", "fewest", "most"), [(0.8, 0, 30), (2.0, 200, 200)])
def test_the_mean_of_light_includes_the_frames_that_show_less(mean, fewest, most):
    """Only frames above 1 grey level counted: 2 ± 0.8 was too bright, and 0.8 ± 0.8 was always reported."""
    drawn = mean + 0.8 * np.random.default_rng(7).standard_normal((200, 40))
    frame = np.arange(40)
    found = [glow([np.array([[0, 1, 0, 0, w]] * 3) for w in wall], frame, RING) for wall in drawn]
    size = [f.mismatch.parameters[0] for f in found if f is not None]
    assert fewest <= len(size) <= most
    assert sum(abs(s.value - mean) < 1.96 * s.sd for s in size) >= 0.92 * fewest
