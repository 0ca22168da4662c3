"""What stays in the picture while the wall moves is found where it is, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.arrays import Float32, Image
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.premises.stays import find_static_places, static_places
from tests.quiet import quiet_context
from tests.ring_images import memory_recording

WALL = np.hypot(*(np.mgrid[:150, :200] - np.array([74.5, 99.5])[:, None, None])) < 70
SIGN = (slice(30, 46), slice(60, 140))


def texture(shape: tuple[int, int], seed: int, finest: float = 2.0) -> Float32:
    white = np.random.default_rng(seed).standard_normal(shape).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(white, (0, 0), finest), np.float32)


def passing(
    count: int = 40, step_px: int = 3, contrast: float = 0.2, sign: float = 0.0, noise: float = 1.0
) -> list[Image]:
    """Return pictures of a wall that moves by so many pixels each, with a fixed sign in front of it."""
    random = np.random.default_rng(5)
    wall = texture((150 + step_px * count, 200), seed=6)
    wall = 100 * (1 + contrast * wall / wall.std())
    drawn = np.zeros((150, 200))
    drawn[SIGN] = sign * np.sign(texture((16, 80), seed=7, finest=1.0))
    moved = [wall[step_px * k : step_px * k + 150] for k in range(count)]
    return [
        np.clip(w + drawn + noise * random.standard_normal(w.shape), 0, 255).astype(np.uint8) for w in moved
    ]


def test_a_sign_that_stays_while_the_wall_moves_is_found_at_its_place() -> None:
    hidden = static_places(passing(sign=60.0), WALL)
    assert hidden[SIGN].mean() > 0.95
    assert hidden.sum() < 1.8 * hidden[SIGN].sum(), "little else is masked"


def test_a_sign_is_found_on_a_plain_wall_too() -> None:
    assert static_places(passing(sign=60.0, contrast=0.0), WALL)[SIGN].mean() > 0.95


@pytest.mark.parametrize(
    "pictures",
    [
        {},
        {"contrast": 0.0},
        {"step_px": 0, "sign": 60.0},
        {"step_px": 0, "noise": 8.0, "contrast": 0.03},
        {"count": 10, "sign": 60.0},
    ],
    ids=["moves", "is plain", "stands still", "stands still in noise", "few pictures"],
)
def test_nothing_is_hidden_where_the_wall(pictures: dict[str, float]) -> None:
    assert not static_places(passing(**pictures), WALL).any()


def test_where_more_stays_than_moves_nothing_is_masked() -> None:
    still = passing(step_px=0, noise=0.0)[0]
    pictures = [np.where(np.arange(200) < 140, still, p).astype(np.uint8) for p in passing(step_px=9)]
    assert not static_places(pictures, WALL).any()


def test_the_line_of_a_laser_that_is_on_in_lit_pictures_is_no_dirt() -> None:
    """The line of a run with both lights was called burnt-in text, a logo or dirt: 9.6 % of the wall."""
    pictures = [cv2.circle(p, (100, 75), 60, 250, 2) for p in passing()]
    recording = memory_recording(dict(enumerate(pictures)), ["both"] * len(pictures), (200, 150))
    camera = KannalaBrandt((200, 150), (60.0, 60.0), (100.0, 75.0))
    probe, told = Probe(camera, LaserSheet(22.0), np.zeros((20, 20))), list[str]()
    context = replace(quiet_context(), warn=told.append)
    for line_px, warned in ((None, True), (np.full(72, 60.0), False)):
        told.clear()
        places = find_static_places(recording, probe, recording.frames.frame, context, line_px)
        assert places is not None
        assert places[75 + 60, 100], "motion does not use it"
        assert bool(told) is warned
