"""The noise floor of a gauge run is the noise that pictures do not repeat, at least that stated of edges."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stages.calibrate.gauge.edges import Edges
from stages.diagnose.gauge.doubts import fits
from stages.diagnose.gauge.equations import EDGE, RING
from stages.diagnose.gauge.heldout import _in_other_pictures, repeatability_px
from stages.diagnose.residual import RingResidual
from stages.diagnose.result import FitQuality

PICTURES, EDGES, RINGS = 24, 160, 8


def floor_px(
    stated_px: float, noise_px: float, left_px: float, pictures: int = PICTURES, rings: int = RINGS
) -> float:
    """Return the floor of fiducials with an instrument off by up to ``left_px``; rings hardly count.

    A ring of each of the last pictures has a noise of 0.3 px.
    """
    random = np.random.default_rng(5)
    count = pictures * EDGES
    uv = random.uniform([300, 200], [900, 700], (count, 2))
    # Edges along and around the pipe.
    normal = np.where(random.random(count)[:, None] < 0.5, [1.0, 0.0], [0.0, 1.0])
    frame = np.repeat(np.arange(pictures), EDGES)
    nowhere, none = np.zeros((count, 3)), np.zeros(count, np.int64)
    edges = Edges(frame, none, none, nowhere, nowhere, uv, normal, np.full(count, stated_px))
    left = left_px * np.sin(uv[:, 0] / 150) * normal[:, 0]
    residual = np.r_[left + random.normal(0, noise_px, count), random.normal(0, 0.3, rings)]
    equations = SimpleNamespace(
        kind=np.repeat([EDGE, RING], [count, rings]), residual=residual,
        weight=np.r_[np.full(count, stated_px**-2), np.full(rings, 1e-9)],
    )  # fmt: skip
    seen = SimpleNamespace(
        outward=np.ones((rings, 2)), frame=np.arange(rings), section=np.zeros(rings, np.int64)
    )
    linearised = SimpleNamespace(equations=equations)
    state = SimpleNamespace(T_pc=np.tile(np.eye(4), (max(pictures, rings), 1, 1)))
    run = SimpleNamespace(edges=edges, rings=seen)
    return repeatability_px(cast(Any, run), cast(Any, SimpleNamespace(linearised=linearised, state=state)))


@pytest.mark.parametrize("left_px", [0.0, 0.4])
def test_the_floor_is_the_fiducials_noise_however_wrong_the_instrument_is(left_px: float) -> None:
    assert floor_px(0.041, 0.09, left_px) == pytest.approx(0.09, rel=0.05)


def test_the_floor_is_at_least_the_noise_stated_of_fiducials() -> None:
    assert floor_px(0.12, 0.09, 0.0) == pytest.approx(0.12, rel=1e-6)


def test_measurements_that_nothing_repeats_do_not_count() -> None:
    assert floor_px(0.04, 0.09, 0.0, rings=1) == pytest.approx(0.09, rel=0.05)
    for pictures in (0, 1):
        assert floor_px(0.04, 0.09, 0.0, pictures, rings=900) == pytest.approx(0.3, rel=0.1)
        assert np.isnan(floor_px(0.04, 0.09, 0.0, pictures, rings=1))


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_edges_give_no_repetition(count: int) -> None:
    edges = SimpleNamespace(
        uv=np.zeros((count, 2)), normal=np.ones((count, 2)), frame=np.zeros(count, np.int64)
    )
    assert [len(of_pair) for of_pair in _in_other_pictures(cast(Any, edges))] == [0, 0]


def test_edges_outside_the_view_form_no_pair() -> None:
    """Formerly they ended the diagnosis with a program error."""
    uv = np.array([[np.nan, np.nan], [5.0, 5.0], [300.0, 5.0], [5.0, 6.0]])
    edges = SimpleNamespace(uv=uv, normal=np.ones((4, 2)), frame=np.arange(4))
    first, second = _in_other_pictures(cast(Any, edges))
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(1, 3), (3, 1)]


def test_with_unknown_noise_an_explanation_fits_only_if_nothing_was_held_out() -> None:
    for floor, fitting in ((0.09, True), (0.05, False), (np.nan, False)):
        quality = FitQuality("px", 1.0, 0.09, 1.0, 0.1, floor)
        assert fits(cast(Any, SimpleNamespace(quality=quality))) is fitting
    not_tried = FitQuality("px", 1.0, 0.09, np.nan, np.nan, np.nan)
    assert fits(cast(Any, SimpleNamespace(quality=not_tried)))


def of_rings(
    noise_px: float, left_px: float, louder_at_ends: float = 1.0, of_last_px: float = 0.0
) -> RingResidual:
    """Return an inspection's rings; the instrument is off by the same up to ``left_px`` in all of them.

    In the last five it is off by ``of_last_px`` more. The noise of the first and the last five is
    ``louder_at_ends`` times as large, as where texture has not yet placed the camera well.
    """
    random = np.random.default_rng(6)
    frame, azimuth = (g.ravel() for g in np.mgrid[:40, -180:180:5])
    angle = np.radians(azimuth)
    noise = noise_px * np.where((frame < 5) | (frame >= 35), louder_at_ends, 1.0)
    residual = (left_px + of_last_px * (frame >= 35)) * np.cos(angle) + random.normal(0, noise)
    return RingResidual(
        "field", frame, angle, angle, 2.0 * frame, np.zeros((len(frame), 2)), residual, residual,
        np.ones(len(frame), bool),
    )  # fmt: skip


@pytest.mark.parametrize("left_px", [0.0, 0.4])
def test_an_inspections_floor_is_the_noise_that_its_rings_do_not_repeat(left_px: float) -> None:
    seen = of_rings(0.07, left_px)
    assert seen.floor_px == pytest.approx(0.07, rel=0.05)
    assert (seen.rms_px > 0.2) == (left_px > 0)


def test_rings_near_the_ends_have_the_same_weight_in_floor_and_residual() -> None:
    seen = of_rings(0.07, 0.0, louder_at_ends=4.0)
    assert seen.floor_px == pytest.approx(seen.rms_px, rel=0.03)


def test_a_common_error_of_all_rings_does_not_lower_the_share_of_noisy_ends() -> None:
    """Beside .2 px in all rings, the share of the ends was 10 % too small."""
    alone, beside = (of_rings(0.07, left_px, louder_at_ends=4.0) for left_px in (0.0, 0.2))
    assert beside.floor_px == pytest.approx(alone.rms_px, rel=0.03)


def test_an_effect_at_one_end_alone_hardly_raises_the_floor() -> None:
    """It was reported as noise of .102 px, beside which nothing stood out."""
    assert of_rings(0.07, 0.0, of_last_px=0.3).floor_px == pytest.approx(0.07, rel=0.15)


@pytest.mark.parametrize("frames", [2, 3, 4, 6])
def test_few_rings_of_an_inspection_give_a_floor(frames: int) -> None:
    seen = of_rings(0.07, 0.4)
    assert replace(seen, usable=seen.frame < frames).floor_px == pytest.approx(0.07, rel=0.2)


def test_one_ring_of_an_inspection_gives_no_floor() -> None:
    seen = of_rings(0.07, 0.0)
    assert np.isnan(replace(seen, usable=seen.frame == 7).floor_px)
