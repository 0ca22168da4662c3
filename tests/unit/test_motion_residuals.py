"""Every derivative of the joint adjustment against central differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.adjustment.motion_priors import smooth_motion_rows, third_difference_coefficients
from pipeline.adjustment.robust import GemanMcClure
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float
from pipeline.artefacts.measured import RingPoints, RingSamples, RingValidity
from pipeline.geometry.axis import to_pipe
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.bundle_adjustment import residuals
from stages.motion.bundle_adjustment.equations import landmark_rows
from stages.motion.bundle_adjustment.unknowns import GLOBALS, State
from stages.motion.parameters import MotionParameters
from stages.motion.rings import circles_in_rings, ring_bins
from tests.exact_rings import seen_above_water
from tests.gauge_runs import stated_probe
from tests.motion_scene import displaced, scene

H = 1e-5


@pytest.fixture(scope="module")
def given():
    made = scene(9, 25, seed=2)
    return made.measured, displaced(made.truth, np.random.default_rng(5), 0.5)


def stepped(
    state: State, *, frame: tuple[int, int] | None = None, border: int | None = None, size: float
) -> State:
    frames, borders = np.zeros((len(state.T_pc), 7)), np.zeros(state.border_size)
    if frame is not None:
        frames[frame] = size
    if border is not None:
        borders[border] = size
    return state.step(frames, borders, np.zeros_like(state.xyz_p))


def slope(function: Callable[[State], Float], state: State, **what) -> Float:
    return (function(stepped(state, size=H, **what)) - function(stepped(state, size=-H, **what))) / (2 * H)


def check_rows(
    make: Callable[[State], Rows], state: State, border_atol: float, frame_atol: float = 1e-5
) -> None:
    rows = make(state)
    for f in (1, 4, len(state.T_pc) - 1):
        for i in range(7):
            wanted = slope(lambda s: make(s).residual, state, frame=(f, i))
            got = np.sum(np.where(rows.frame == f, rows.by_frame[:, :, i], 0.0), 1)
            atol = frame_atol * (60 if 3 <= i < 6 else 1)  # lever arm of a rotation, mm
            np.testing.assert_allclose(got, wanted, atol=atol, err_msg=f"frame {f} coordinate {i}")
    for b in range(state.border_size):
        wanted = slope(lambda s: make(s).residual, state, border=b)
        np.testing.assert_allclose(rows.by_border[:, b], wanted, atol=border_atol, err_msg=f"border {b}")


def test_steps_of_the_bore_are_found_and_the_wall_follows_them(given) -> None:
    random, at_mm = np.random.default_rng(7), 0.8 * np.arange(100)
    wavy = 50 + 0.2 * np.sin(at_mm / 6) + 0.03 * random.standard_normal(100)
    wavy[60:70] -= 1.0  # a weld
    radius_mm = np.where(at_mm < 32, wavy, wavy - 2.0)
    radius_mm[[7, 41]] = np.nan, 70.0
    order = random.permutation(100)
    assert not len(Bore.of(wavy, at_mm).at_mm), "control: a pipe of one bore has none"
    steps = Bore.of(radius_mm[order], at_mm[order])
    assert steps.at_mm == pytest.approx([32.0])
    assert steps.wider_mm == pytest.approx([2.0, 0.0], abs=0.3)

    state = given[1]
    wall = state.xyz_p
    narrow = replace(state, bore=Bore(np.array([30.0]), np.array([0.0, -2.0])))
    apart = residuals.surface(narrow, wall)[0] - residuals.surface(state, wall)[0]
    np.testing.assert_allclose(apart, np.where(to_pipe(state.axis, wall)[0] > 30, 2.0, 0.0), atol=1e-9)


def test_relief_of_the_wall_does_not_pull_the_instrument() -> None:
    """Rings of a rough wall and a true probe: residual and derivative must be uncorrelated."""
    random, azimuth = np.random.default_rng(4), np.linspace(-np.pi, np.pi, 720, endpoint=False)
    probe, rough_mm, frames = stated_probe(), 1.0, 60
    radius_mm = 50 + rough_mm * random.standard_normal((frames, len(azimuth)))
    wall = np.stack([radius_mm * np.cos(azimuth), radius_mm * np.sin(azimuth), 0 * radius_mm], -1)
    wall[..., 2] = probe.laser.baseline_mm
    uv = probe.camera.project(wall).uv - probe.camera.centre_px
    radius_px = np.linalg.norm(uv, axis=-1).astype(np.float32)
    alike = np.full(radius_px.shape, 0.01, np.float32)
    valid = np.full(radius_px.shape, RingValidity.VALID, np.uint8)
    samples = RingSamples(
        np.arange(frames), azimuth, probe.camera.centre_px, radius_px, alike, alike, alike, valid
    )
    bins = ring_bins(samples, np.arange(frames), probe, 720, 0.1)
    off, normal_c = np.hypot(*bins.xyz_c[:, :2].T) - 50, bins.xyz_c * [1.0, 1.0, 0.0]
    normal_c /= np.linalg.norm(normal_c, axis=1)[:, None]

    def pull(by_instrument: Float) -> Float:
        """Return by how many σ the residuals pull each correction."""
        score = off[:, None] * np.einsum("mj,mjq->mq", normal_c, by_instrument)
        return np.abs(score.sum(0)) / np.sqrt(np.sum(score**2, 0))

    assert pull(bins.instrument_where_expected(off, normal_c)).max() < 3.5
    assert pull(bins.by_instrument).max() > 5, "control: derivatives at the measured ring pull"


def test_ring_rows(given) -> None:
    measured, state = given
    # The frames of the axis rotate a little with its deflection, which the derivative neglects.
    check_rows(lambda s: residuals.ring_rows(s, measured.rings, GemanMcClure(0.1)), state, 0.02, 2e-4)


def test_ring_rows_in_a_taper(given) -> None:
    measured, state = given
    # One slope throughout, so that no difference is taken across an edge.
    taper = replace(ONE_BORE, rings_mm=np.array([-50.0, 300.0]), rings_wider_mm=np.array([-12.0, 30.0]))
    rings = measured.rings
    taper = taper.measured_by(rings.xyz_c, rings.by_instrument, state.nominal_radius_mm)
    guess_mm = to_pipe(state.axis, state.T_pc[:, :3, 3])[0] - 0.7

    def rows(there: State, bore: Bore) -> Rows:
        return residuals.ring_rows(replace(there, bore=bore, guess_mm=guess_mm), rings, GemanMcClure(0.1))

    check_rows(lambda s: rows(s, taper), state, 0.02, 3e-4)
    held = replace(taper, by_instrument=np.zeros((2, 0)))
    follow = rows(state, taper).by_border - rows(state, held).by_border
    first = state.border_size - len(state.instrument)
    for b in range(first, state.border_size):
        wanted = slope(lambda s: rows(s, taper).residual - rows(s, held).residual, state, border=b)
        np.testing.assert_allclose(follow[:, b], wanted, atol=1e-5, err_msg=f"border {b}")
    assert np.abs(follow).max() > 1e-3, "control: widths follow the instrument"


def test_encoder_rows(given) -> None:
    measured, state = given
    reading, slip = (lambda s, k=k: residuals.encoder_rows(s, measured.encoder, 0.01)[k] for k in (0, 1))
    check_rows(slip, state, 1e-6)
    check_rows(reading, state, 0.05, 1e-4)


def test_no_slip_rows(given) -> None:
    check_rows(residuals.no_slip_rows, given[1], 1e-6)


def test_turn_rows(given) -> None:
    check_rows(lambda s: residuals.turn_rows(s, 0.1), given[1], 1e-9, frame_atol=0.1 / 60)


def test_view_rows(given) -> None:
    # The frame rotates with its axis by 1/30 rad per mm of a knot: otherwise steps end beside the optimum.
    check_rows(residuals.view_rows, given[1], 0.004, frame_atol=1e-3)


def test_axis_and_prior_rows(given) -> None:
    check_rows(lambda s: residuals.axis_rows(s, 2e-3), given[1], 1e-5)
    check_rows(lambda s: residuals.prior_rows(s, 0.002, 5.0), given[1], 1e-5)


def test_smooth_rows(given) -> None:
    measured, state = given
    make = lambda s: smooth_motion_rows(s.T_pc, measured.time_s, measured.smooth_sigma, s.border_size)  # noqa: E731
    # Rotations are treated as a vector space, exact to the rotation between neighbours, about 0.03 rad.
    check_rows(make, state, 1e-9, frame_atol=0.1 / 60)
    rows = make(state)
    for i in range(3):
        wanted = slope(lambda s: make(s).residual, state, frame=(4, i))
        got = np.sum(np.where(rows.frame == 4, rows.by_frame[:, :, i], 0.0), 1)
        np.testing.assert_allclose(got, wanted, atol=1e-6)


def test_third_differences_ignore_parabolas_at_any_spacing() -> None:
    t = np.array([[0.0, 0.1, 0.25, 0.3], [1.0, 2.0, 3.0, 4.0]])
    coefficient = third_difference_coefficients(t)
    np.testing.assert_allclose(coefficient[1], [-1, 3, -3, 1], atol=1e-12)
    for power in range(3):
        np.testing.assert_allclose(np.sum(coefficient * (t - t[:, :1]) ** power, 1), 0, atol=1e-12)
    cubic = np.sum(coefficient * (3 * (t - t[:, :1]) / np.ptp(t, axis=1)[:, None]) ** 3, 1)
    np.testing.assert_allclose(cubic, 6)


def test_surface_by_point_and_border(given) -> None:
    _, state = given
    random = np.random.default_rng(0)
    xyz = state.xyz_p + random.standard_normal(state.xyz_p.shape)
    _, gradient, by_border = residuals.surface(state, xyz)
    for i in range(3):
        d = H * np.eye(3)[i]
        wanted = (residuals.surface(state, xyz + d)[0] - residuals.surface(state, xyz - d)[0]) / (2 * H)
        np.testing.assert_allclose(gradient[:, i], wanted, atol=1e-4)
    for b in range(GLOBALS):
        wanted = slope(lambda s: residuals.surface(s, xyz)[0], state, border=b)
        np.testing.assert_allclose(by_border[:, b], wanted, atol=1e-6)


def test_landmark_rows(given) -> None:
    measured, state = given
    parameters = MotionParameters()
    residual = lambda s: landmark_rows(s, measured, parameters).residual  # noqa: E731
    rows = landmark_rows(state, measured, parameters)
    for f in (1, 5):
        for i in range(6):
            wanted = slope(residual, state, frame=(f, i))
            got = np.where((rows.frame == f)[:, None], rows.by_pose[:, :, i], 0.0)
            np.testing.assert_allclose(got, wanted, rtol=2e-3, atol=3e-3, err_msg=f"pose {i}")
    first = state.border_size - rows.by_instrument.shape[2]
    for b in range(state.border_size):
        wanted = slope(residual, state, border=b)
        got = rows.by_instrument[:, :, b - first] if b >= first else np.zeros_like(wanted)
        np.testing.assert_allclose(got, wanted, rtol=2e-3, atol=1e-4, err_msg=f"border {b}")
    for i in range(3):
        step = np.zeros_like(state.xyz_p)
        step[:, i] = H
        frames, border = np.zeros((len(state.T_pc), 7)), np.zeros(state.border_size)
        ahead, behind = (residual(state.step(frames, border, k * step)) for k in (1, -1))
        np.testing.assert_allclose(rows.by_point[:, :, i], (ahead - behind) / (2 * H), rtol=2e-3, atol=3e-3)


def test_a_landmark_behind_the_lens_is_left_out(given) -> None:
    measured, state = given
    camera = measured.probe.camera
    narrow = camera.with_parameters(np.array([*camera.parameters[:4], -0.1, 0, 0, 0]))
    measured = replace(measured, probe=replace(measured.probe, camera=narrow))
    step = np.zeros_like(state.xyz_p)
    step[0, 2] = -500.0
    moved = state.step(np.zeros((len(state.T_pc), 7)), np.zeros(state.border_size), step)
    rows = landmark_rows(moved, measured, MotionParameters())
    astray = measured.tracks.landmark == 0
    assert np.isfinite(rows.cost)
    assert np.all(rows.by_pose[astray] == 0)
    assert np.all(rows.by_point[astray] == 0)
    stayed = landmark_rows(state, measured, MotionParameters())
    assert rows.cost > stayed.cost, "otherwise the adjustment would gain by losing landmarks"


def test_distant_mirrored_points_do_not_pull_the_circle() -> None:
    """Reflected in standing water, a third of the line lay up to 9 m away: motion saw a pipe 1 m wide."""
    azimuth = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    radius = np.where(azimuth > np.pi / 3, np.random.default_rng(1).uniform(50, 9000, 360), 50.0)
    xyz = np.stack([3 + radius * np.cos(azimuth), radius * np.sin(azimuth), 0 * azimuth], -1)
    noise = np.zeros_like(xyz)
    points = RingPoints(np.arange(3), azimuth, np.stack([xyz] * 3), np.stack([noise] * 3))
    circles = circles_in_rings(points)
    np.testing.assert_allclose(circles.radius_mm, 50, atol=0.1)
    np.testing.assert_allclose(circles.centre_c, [[3, 0]] * 3, atol=0.1)


def test_the_circle_of_a_ring_mirrored_in_water_is_that_of_its_upper_part() -> None:
    """With 40 % of the line mirrored, circles were 9 % too wide and 5 mm off."""
    azimuth = np.linspace(-np.pi, np.pi, 1440, endpoint=False)
    xy = seen_above_water(azimuth, radius=50.0, centre_y=-2.0, water_y=9.0)
    xyz = np.concatenate([xy, np.zeros((1440, 1))], -1)
    points = RingPoints(np.arange(3), azimuth, np.stack([xyz] * 3), np.zeros((3, 1440, 3)))
    circles = circles_in_rings(points)
    np.testing.assert_allclose(circles.radius_mm, 50, atol=0.1)
    np.testing.assert_allclose(circles.centre_c, [[0, -2]] * 3, atol=0.1)
