"""Gains of single pixels are found; errors of a codec in whole blocks are not taken for them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.arrays import Float
from stages.diagnose.profile.width import pattern_finding

SIZE = (320, 320)
BRIGHT = 2e5


def seen(lasting: Float, noise: float = 0.01) -> Any:
    """Return two halves of the frames: gains (H, W) that are the same in both, and random others."""
    random = np.random.default_rng(4)
    halves = [lasting + noise * random.standard_normal(lasting.shape) for _ in range(2)]
    square = np.full(lasting.size, BRIGHT)
    return cast(Any, SimpleNamespace(gain=np.array([[g.ravel() * BRIGHT, square] for g in halves])))


def of_blocks(size: float) -> Float:
    """Return errors of a codec: waves of blocks of 8 px, equal over some of their pixels."""
    random = np.random.default_rng(5)
    wave = np.cos(np.pi * (np.arange(8) + 0.5) / 8)
    fine = np.cos(5 * np.pi * (np.arange(8) + 0.5) / 8)
    blocks = size * random.standard_normal((SIZE[1] // 8, 1, SIZE[0] // 8, 1))
    return np.asarray((blocks * wave[:, None, None] * fine).reshape(SIZE[::-1]))


@pytest.mark.parametrize(
    ("lasting", "is_found"),
    [
        (0.05 * np.random.default_rng(3).standard_normal(SIZE[::-1]), True),
        (of_blocks(0.2), False),
        (np.zeros(SIZE[::-1]), False),
    ],
)
def test_only_constant_gains_of_single_pixels_are_a_fixed_pattern(lasting: Float, is_found: bool) -> None:
    found = pattern_finding(seen(lasting), SIZE)
    assert found.found is is_found
    if is_found:
        assert found.sizes[0].value == pytest.approx(0.05, rel=0.2)
