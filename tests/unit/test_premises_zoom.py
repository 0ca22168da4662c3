"""Pictures that are enlarged or reduced from some frame on."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.recording.base import Recording
from stages.premises.light import Light
from stages.premises.losses import Steps
from stages.premises.pictures import Pictures
from stages.premises.zoom import zooms
from tests.drawn_run import DrawnRun
from tests.premises_run import COUNT, checked
from tests.ring_images import MemorySource

FIRST = 30


def zoomed(good: Recording, run: DrawnRun, factor: float) -> Recording:
    """Return a recording whose pictures are scaled about their centre from frame `FIRST` on."""
    centre = np.asarray(run.probe.camera.centre_px)
    move = np.column_stack([factor * np.eye(2), (1 - factor) * centre])
    size = run.probe.camera.image_size
    shown = {
        k: cv2.warpAffine(i, move, size, flags=cv2.INTER_CUBIC) if k >= FIRST else i
        for k, i in good.source.images.items()
    }
    return replace(good, source=MemorySource(shown, size))


@pytest.mark.parametrize(("factor", "told"), [(1.03, "enlarged by 2.8"), (0.96, "reduced by 3.7")])
@pytest.mark.parametrize("encoder", [False, True])
def test_a_zoom_is_named_and_is_no_loss(factor, told, encoder, good, run):
    """Of open-1, 3 % larger from its middle on, 4 pictures "were lost", and times came from other rows."""
    spoiled = zoomed(good if encoder else replace(good, encoder=None), run, factor)
    found, said = checked(spoiled, run.probe)
    assert found.frame.tolist() == list(range(COUNT))
    np.testing.assert_allclose(found.time_s, good.frames.time_s)
    named = [s for s in said if told in s]
    assert len(named) == 1
    assert any(f"from about frame {k} on" in named[0] for k in (FIRST, FIRST + 1))
    assert not any("lost" in s.split(":")[0] for s in said)


@pytest.mark.parametrize(
    ("line_grows", "wall_steps", "told"),
    [(0.03, 0.0435, 1), (0.03, 0.0, 0), (0.0, 0.0435, 0), (0.03, -0.0435, 0)],
    ids=["zoom", "wider bore", "lost pictures", "wall goes back"],
)
def test_only_what_moves_line_and_wall_alike_is_a_zoom(line_grows, wall_steps, told):
    found = zooms(*pictures_and_steps(line_grows, 0.02 + wall_steps * (np.arange(59) == 29)))
    assert len(found) == told
    assert all(abs(zoom.growth - np.log(1.03)) < 1e-6 and zoom.place == 60 for zoom in found)


@pytest.mark.parametrize("line_grows", [0.01, -0.01, 0.02])
def test_another_bore_is_no_zoom_where_a_probe_is_pulled_by_hand(line_grows):
    """In a third of such runs a step of the wall fitted by chance, and a zoom was named."""
    draws = [np.random.default_rng(seed).normal(0, 0.2, 59) for seed in range(40)]
    assert not any(zooms(*pictures_and_steps(line_grows, 0.06 * np.exp(draw))) for draw in draws)


def pictures_and_steps(line_grows, size):
    """Return pictures whose line grows at frame 60, their lights, and steps of a ``size`` (59,)."""
    frame = np.arange(120)
    light = np.where(frame % 2 == 0, Light.WALL, Light.LINE)
    line = np.full((120, 128), 100, np.float32)
    line[frame >= 60] *= 1 + line_grows
    nothing = np.full(120, np.nan)
    pictures = Pictures(
        nothing, np.ones(120), np.round(line), np.zeros(128), nothing, frame - 2, nothing, nothing
    )
    lit = frame[::2]
    return pictures, light, Steps(lit[:-1], lit[1:], size)
