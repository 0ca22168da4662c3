"""Whether a change of the coding is told from changes of light and from noise that varies by itself."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.fine_noise import FineNoise, beside_coding
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring

SHAPE, FRAMES, SIGMA = (120, 160), 12, 2.0
RING = Ring((80.0, 60.0), 40.0, 50.0, 23.0)


def _noise(kind, k, random):
    """Return the noise (H, W) of frame k, with the factor by which the model overstates its variance."""
    white = SIGMA * random.standard_normal(SHAPE)
    late = k >= FRAMES // 2
    if kind == "coded":
        return (cv2.GaussianBlur(white, (0, 0), 0.6) if late else white), 1.0
    if kind == "two kinds of frames":
        return white * (1.0, 0.7)[k % 2], 1.0
    if kind == "growing":
        return white * 1.07**k, 1.0
    if kind == "exposure":
        return white * np.sqrt(2.0 if late else 1.0), 2.0 if late else 1.0
    if kind == "light":
        return white + (8.0 if late else 0.0) * np.linspace(-1, 1, SHAPE[1]), 1.0
    return white, 1.0


def _found(kind, seed=1):
    random, fine = np.random.default_rng(seed), FineNoise()
    nowhere = np.full(SHAPE, np.nan, np.float32)
    for k in range(FRAMES):
        noise, variance = _noise(kind, k, random)
        twin = TwinFrame(
            np.full(SHAPE, 80.0, np.float32), np.full(SHAPE, SIGMA**2 * variance, np.float32),
            np.full(SHAPE, Region.WALL, np.uint8), nowhere, nowhere,
        )  # fmt: skip
        fine.add(8 * k, (80 + noise).astype(np.float32), twin, np.ones(SHAPE, bool))
    return fine.step(RING)


def test_another_coding_is_found_at_its_frame_without_a_name():
    (found,) = _found("coded")
    assert found.name == ""
    assert found.fixed_to == "time"
    assert found.place[0].value == pytest.approx(44, abs=4)
    assert found.parameters[0].value < -0.3


@pytest.mark.parametrize("kind", ["nothing", "two kinds of frames", "growing", "exposure", "light"])
def test_other_changes_are_no_change_of_the_coding(kind):
    assert [_found(kind, seed) for seed in range(5)] == [()] * 5


def test_too_few_frames_tell_nothing():
    assert FineNoise([0, 1, 2], [0.0, 0.0, -1.0]).step(RING) == ()


def _cause(name, channel, frame):
    at = () if frame is None else (NamedFigure("frame_from", frame, 2.3, "frame"),)
    return Mismatch(name, channel, "time", at, (), 1e-6, 2.0, 1.0, "Something.")


def test_beside_another_coding_no_light_is_named_for_it():
    coding = _found("coded")
    sector, same, other, blink = (
        _cause("laser_sector", "line", None), _cause("lamp_step", "intensity", 46.0),
        _cause("lamp_step", "intensity", 12.0), _cause("flicker", "intensity", 0.0),
    )  # fmt: skip
    left, withdrawn = beside_coding((sector, same, other, blink), coding)
    assert left == (other, blink)
    assert all("coded differently from frame 44" in m.statement for m in withdrawn)
    assert len(withdrawn) == 2
    # Crf 34 in the first half made up to six places "where the line is displaced in all frames".
    place = _cause("", "line", None)
    assert beside_coding((place,), (*coding, blink))[0] == ()
    assert beside_coding((place,), (blink,)) == ((place,), ())
    assert beside_coding((sector, same), ()) == ((sector, same), ())
