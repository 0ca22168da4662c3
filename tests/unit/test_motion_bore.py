"""The bore estimated from rings: reducers, and the wall in them."""

from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.geometry.axis import to_pipe
from stages.motion import MotionParameters
from stages.motion.bore import ONE_BORE, Bore, warn_of_steps
from stages.motion.bundle_adjustment import equations, residuals
from stages.motion.bundle_adjustment.beyond_rings import held_beyond_rings
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.rings import RingBins
from stages.motion.tracking.strips import StripGrid
from tests.motion_scene import RADIUS, Scene, joint_at, scene
from tests.quiet import quiet_context

AT_MM = 0.8 * np.arange(100)
WIDER_MM = -np.clip((AT_MM - 35) * 0.8, 0, 9.6)
RELIEF_MM = 0.03 * np.random.default_rng(3).standard_normal(100)
REDUCER = replace(ONE_BORE, rings_mm=AT_MM, rings_wider_mm=WIDER_MM)


def test_the_radius_in_a_reducer_is_that_of_its_rings() -> None:
    seen = 50 + WIDER_MM + RELIEF_MM
    seen[[7, 40]] = np.nan, 70.0
    bore = Bore.of(seen, AT_MM)
    assert bore.reduces
    assert bore.wider_at(AT_MM) + np.nanmedian(seen) == pytest.approx(50 + WIDER_MM, abs=0.4)
    inside = np.array([38.1, 42.1, 45.3])
    assert bore.slope_at(inside) == pytest.approx(-0.8, abs=0.15)
    assert bore.counted_from(10.0).wider_at(inside - 10) == pytest.approx(bore.wider_at(inside))


@pytest.mark.parametrize("step_mm", [0.0, -3.0])
def test_a_pipe_of_one_bore_or_with_a_step_has_no_reducer(step_mm: float) -> None:
    bore = Bore.of(50.0 + RELIEF_MM + step_mm * (AT_MM > 40), AT_MM)
    assert not bore.reduces
    assert len(bore.at_mm) == (step_mm != 0)
    said: list[str] = []
    warn_of_steps(bore, replace(quiet_context(), warn=said.append))
    assert len(said) == (step_mm != 0)
    assert step_mm == 0 or "steps by -6.0 mm at 41 mm" in said[0]


@pytest.mark.parametrize(
    ("height_mm", "apart_mm", "follows"), [(0.5, 11, True), (0.2, 11, False), (0.9, 400, False)]
)
def test_the_radius_between_ribs_is_that_of_the_rings(
    height_mm: float, apart_mm: float, follows: bool
) -> None:
    """A ribbed pipe was taken for a cylinder, and the poses were turned until it was one.

    Rings that grow over the whole run may be a lens that warms up, and are no ribs.
    """
    ribs = height_mm * np.sin(2 * np.pi * (AT_MM - 40) / apart_mm)
    bore = Bore.of(50.0 + RELIEF_MM + ribs, AT_MM)
    assert bore.reduces == follows
    assert not len(bore.at_mm)
    if follows:
        assert bore.wider_at(AT_MM) == pytest.approx(ribs, abs=0.15)


@pytest.mark.parametrize("height_mm", [0.0, 0.5])
def test_ribs_are_told_where_the_probe_stood_as_well(height_mm: float) -> None:
    """Twelve of 48 rings at one place hid the ribs: 52 % inside, two of three defects lost."""
    at_mm = np.sort(np.concatenate([42 / 36 * np.arange(36), 21 + 0.02 * RELIEF_MM[:12]]))
    seen = 38 + 0.3 * RELIEF_MM[:48] + height_mm * np.sin(2 * np.pi * at_mm / 11)
    assert Bore.of(seen, at_mm).reduces == (height_mm > 0)


def test_a_reducer_is_reported_as_such_and_not_as_a_step() -> None:
    said: list[str] = []
    warn_of_steps(REDUCER, replace(quiet_context(), warn=said.append))
    assert said == []


def test_the_wall_of_a_reducer_slopes() -> None:
    state = replace(scene(9, 25, seed=2).truth, bore=REDUCER)
    inside = state.xyz_p * [1, 1, 0] + [0, 0, 40.1]
    _, gradient, _ = residuals.surface(state, inside)
    for i, h in enumerate(1e-4 * np.eye(3)):
        ahead, behind = (residuals.surface(state, inside + sign * h)[0] for sign in (1, -1))
        np.testing.assert_allclose(gradient[:, i], (ahead - behind) / 2e-4, atol=0.02, err_msg=str(i))
    assert np.abs(gradient[:, 2]).min() > 0.5, "control: it does slope"


def test_a_reducer_does_not_pull_the_probe_to_where_its_rings_were_first_assumed() -> None:
    made = scene(60, 25, seed=2)
    guess = made.truth.T_pc[:, 2, 3]
    state = replace(made.truth, bore=REDUCER, guess_mm=guess)
    ahead = state.T_pc.copy()
    ahead[:, 2, 3] += 0.03 * guess

    def off(there: State) -> Float:
        return residuals.ring_rows(there, made.measured.rings, residuals.Squares()).residual

    farther = replace(state, T_pc=ahead)
    by_place, by_place_farther = (replace(s, guess_mm=np.zeros(0)) for s in (state, farther))
    apart = np.abs(off(farther) - off(state)).max()
    held = np.abs(off(by_place_farther) - off(by_place)).max()
    assert apart < 0.1 * held, "if looked up by position, rings would move the probe back"
    moved = farther.with_bore_in_place(made.measured.probe.laser.baseline_mm)
    assert moved.bore.rings_mm[60] - AT_MM[60] == pytest.approx(0.03 * (AT_MM[60] - 22), abs=0.1)


def test_texture_matches_in_a_reducer_have_a_larger_sigma() -> None:
    """The radius is known as well as half a millimetre along the pipe: 0.4 mm across at a slope of 0.8."""
    made = scene(60, 25, seed=2)
    state, parameters = replace(made.truth, bore=REDUCER), MotionParameters(surface_sigma_mm=0.1)
    at_mm = to_pipe(state.axis, state.xyz_p)[0]
    inside, outside = (at_mm > 36) & (at_mm < 46), (at_mm < 34) | (at_mm > 48)
    sigma_mm = equations.landmark_rows(state, made.measured, parameters).surface_sigma
    assert inside.any()
    assert outside.any()
    assert sigma_mm[inside] == pytest.approx(np.hypot(0.1, 0.4), rel=1e-6)
    assert sigma_mm[outside] == pytest.approx(0.1)


def test_strips_are_sampled_on_the_wall() -> None:
    wider = Bore(np.array([30.0]), np.array([0.0, 6.5]))
    grid = StripGrid(RADIUS, 480, 12.0, 60.0, wider)
    row = np.arange(60.0) / grid.step_mm
    assert np.hypot(*grid.wall(row, 0 * row)[:, :2].T) == pytest.approx(RADIUS + 6.5 * (np.arange(60) > 30))


def beyond_the_rings(step_mm: float) -> tuple[Scene, Measurements, State]:
    """Return a scene whose rings end before the wall's step, what is measured in it, and a start."""
    frames, passed = 24, 12
    made = scene(frames, 200, noise=1.0, encoder=False, seed=1, joint_mm=(step_mm, 0.0))
    rings = made.measured.rings
    reached = RingBins(*(getattr(rings, f.name)[rings.frame < passed] for f in fields(rings)))
    at_mm = made.truth.T_pc[:passed, 2, 3] + made.measured.probe.laser.baseline_mm
    assert at_mm[-1] < joint_at(frames), "control: no ring reaches the step"
    start = replace(made.truth, bore=Bore.of(np.full(passed, RADIUS), at_mm))
    return made, replace(made.measured, rings=reached), start


@pytest.mark.parametrize("step_mm", [-1.5, 1.5])
def test_a_step_of_the_wall_that_no_ring_reaches_is_not_taken_for_distance(step_mm: float) -> None:
    """Seen in texture alone, it made a distance 2.2 % too short, by 5 σ of the encoder that was right."""
    made, measured, start = beyond_the_rings(step_mm)
    found = estimate_state(start, measured, MotionParameters(alike=1.0))
    error_mm = found.state.T_pc[-1, 2, 3] - made.truth.T_pc[-1, 2, 3]
    last = np.array([len(made.truth.T_pc) - 1])
    sigma_mm = float(np.sqrt(found.factor.joint_covariance(last)[0, 2, 0, 2]))
    assert sigma_mm < 0.1
    assert abs(error_mm) < 2 * sigma_mm


@pytest.mark.parametrize("step_mm", [-1.5, 0.0, 1.5])
def test_texture_beyond_the_rings_is_held_to_their_radius_unless_it_shows_a_step(step_mm: float) -> None:
    _, measured, start = beyond_the_rings(step_mm)
    parameters, watch = MotionParameters(alike=1.0), lambda *_: None
    free = estimate_state(start, measured, parameters)
    held = held_beyond_rings(free, measured, parameters, watch)
    assert (held is free) == (step_mm != 0)
    assert np.isinf(held.state.bore.measured_mm).all() == (step_mm == 0)
    assert np.array_equal(held.smooth_sigma, free.smooth_sigma), "it continues as the same motion"


def test_texture_has_no_known_radius_where_no_ring_was() -> None:
    made = scene(40, 90, seed=1)
    bore = Bore.of(np.full(40, RADIUS), made.truth.T_pc[:, 2, 3] + 22.0)
    at_mm = to_pipe(made.truth.axis, made.truth.xyz_p)[0]
    rows = equations.landmark_rows(replace(made.truth, bore=bore), made.measured, MotionParameters())
    measured = (at_mm > 22.0) & (at_mm < 22.0 + 1.2 * 39)
    assert rows.surface_sigma[measured] == pytest.approx(0.1)
    assert rows.surface_sigma[~measured].min() > RADIUS - 1
    assert bore.counted_from(10.0).measured_mm == pytest.approx((12.0, 12.0 + 1.2 * 39))


@pytest.mark.parametrize(
    ("off_mm", "scatter_mm", "steps"),
    [(0.0, 0.8, False), (0.3, 0.1, False), (1.5, 0.9, True), (-1.5, 0.9, True), (1.5, 30.0, False)],
)
def test_texture_beyond_the_rings_shows_a_step_or_lies_on_their_wall(
    off_mm: float, scatter_mm: float, steps: bool
) -> None:
    """Free of the rings' radius, texture moved the sheet of open-3 by 14 σ, though its pipe has one bore."""
    random = np.random.default_rng(5)
    distance, off = np.arange(0.0, 90.0, 0.5), 0.02 * random.standard_normal(180)
    beyond = distance > 60
    off[beyond] = off_mm + scatter_mm * random.standard_normal(beyond.sum())
    bore = replace(ONE_BORE, measured_mm=(0.0, 60.0))
    assert bore.steps_beyond(distance, off) == steps
    assert not bore.steps_beyond(distance[~beyond], off[~beyond]), "no texture is beyond the rings"
