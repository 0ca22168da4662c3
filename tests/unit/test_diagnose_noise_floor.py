"""The noise floor of a gauge run is what other pictures do not repeat, at least what is stated of edges."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stages.calibrate.gauge.edges import Edges
from stages.diagnose.gauge.elimination import EDGE, RING
from stages.diagnose.gauge.heldout import repeatability_px
from stages.diagnose.residual import RingResidual

PICTURES, EDGES, RINGS = 24, 160, 8


def floor_px(stated_px: float, noise_px: float, left_px: float) -> float:
    """Return the floor of fiducials whose instrument is off by up to ``left_px``; rings hardly count."""
    random = np.random.default_rng(5)
    count = PICTURES * EDGES
    uv = random.uniform([300, 200], [900, 700], (count, 2))
    # Edges along and around the pipe.
    normal = np.where(random.random(count)[:, None] < 0.5, [1.0, 0.0], [0.0, 1.0])
    frame = np.repeat(np.arange(PICTURES), EDGES)
    nowhere, none = np.zeros((count, 3)), np.zeros(count, np.int64)
    edges = Edges(frame, none, none, nowhere, nowhere, uv, normal, np.full(count, stated_px))
    left = left_px * np.sin(uv[:, 0] / 150) * normal[:, 0]
    residual = np.r_[left + random.normal(0, noise_px, count), np.zeros(RINGS)]
    equations = SimpleNamespace(
        kind=np.repeat([EDGE, RING], [count, RINGS]), residual=residual,
        weight=np.r_[np.full(count, stated_px**-2), np.full(RINGS, 1e-9)],
    )  # fmt: skip
    way = np.ones((RINGS, 3))
    rings = SimpleNamespace(
        outward=np.ones((RINGS, 2)), frame=np.arange(RINGS), section=np.zeros(RINGS, np.int64)
    )
    linearised = SimpleNamespace(equations=equations, rings=SimpleNamespace(normal_c=way, per_px_c=way))
    state = SimpleNamespace(T_pc=np.tile(np.eye(4), (PICTURES, 1, 1)))
    run = SimpleNamespace(edges=edges, rings=rings)
    return repeatability_px(cast(Any, run), cast(Any, SimpleNamespace(linearised=linearised, state=state)))


@pytest.mark.parametrize("left_px", [0.0, 0.4])
def test_it_is_the_fiducials_own_noise_whatever_the_instrument_is_off_by(left_px: float) -> None:
    assert floor_px(0.041, 0.09, left_px) == pytest.approx(0.09, rel=0.05)


def test_it_is_no_less_than_what_is_stated_of_fiducials() -> None:
    assert floor_px(0.12, 0.09, 0.0) == pytest.approx(0.12)


def of_rings(noise_px: float, left_px: float) -> RingResidual:
    """Return an inspection's rings, the instrument off by up to ``left_px`` alike in all of them."""
    random = np.random.default_rng(6)
    frame, azimuth = (g.ravel() for g in np.mgrid[:40, -180:180:5])
    angle = np.radians(azimuth)
    residual = left_px * np.cos(angle) + random.normal(0, noise_px, len(frame))
    return RingResidual(
        "field", frame, angle, angle, 2.0 * frame, np.zeros((len(frame), 2)), residual, residual,
        np.ones(len(frame), bool),
    )  # fmt: skip


@pytest.mark.parametrize("left_px", [0.0, 0.4])
def test_an_inspections_floor_is_what_its_rings_do_not_repeat(left_px: float) -> None:
    seen = of_rings(0.07, left_px)
    assert seen.floor_px == pytest.approx(0.07, rel=0.05)
    assert (seen.rms_px > 0.2) == (left_px > 0)
