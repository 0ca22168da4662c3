"""Fog and automatic exposure are told; good pictures are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Image
from pipeline.recording.base import Illumination, Recording
from tests.drawn_run import DrawnRun
from tests.premises_run import checked
from tests.ring_images import MemorySource


def painted(good: Recording, paint: Callable[[int, Image], np.ndarray]) -> Recording:
    """Return a recording with each of its pictures painted over."""
    images = {
        k: np.clip(paint(k, i.astype(float)) + 0.5, 0, 255).astype(np.uint8)
        for k, i in good.source.images.items()
    }
    return replace(good, source=MemorySource(images, good.source.image_size))


@pytest.mark.parametrize(("veil", "told"), [(0.0, False), (0.3, True)])
def test_fog_is_told(good: Recording, run: DrawnRun, veil: float, told: bool) -> None:
    """Mist takes light away and lifts what is dark; fog went through a whole run without a word."""
    found = checked(painted(good, lambda k, i: (1 - 2 * veil) * i + 40 * veil), run.probe)[1]
    assert any("veils the wall" in t for t in found) is told


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize(("swing", "told"), [(0.05, False), (0.4, True)])
def test_exposure_that_swings_is_told(
    good: Recording, run: DrawnRun, swing: float, told: bool, mixed: bool
) -> None:
    """Pumping gain went through a whole run without a word; also where all lights are on."""
    if mixed:
        lit = good.frames.of(Illumination.LED)
        table = replace(good.frames, illumination=np.full(len(good.frames.frame), "both"))
        images = {k: good.source.images[int(lit[k // 2])] for k in good.source.images}
        good = replace(good, frames=table, source=MemorySource(images, good.source.image_size))
    found = checked(painted(good, lambda k, i: i * (1 + swing * np.sin(k / 6))), run.probe)[1]
    assert any("times as bright in some pictures" in t for t in found) is told
