"""Smooth displacements of the picture are found where texture and line show one wall at different radii."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from pipeline.arrays import Float
from pipeline.geometry.axis import from_pipe, to_pipe
from pipeline.geometry.rigid import inverse, transform
from stages.motion import MotionParameters, estimate_motion
from stages.motion.bore import ONE_BORE
from stages.motion.bundle_adjustment import wall_twice as wt
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.bundle_adjustment.wall_twice import WallTwice, wall_twice
from tests.drawn_run import drawn_run
from tests.motion_scene import RADIUS, Scene, joint_at, scene
from tests.quiet import quiet_context

PATCH_MM = 4.6
FRAMES, LANDMARKS = 36, 1000


def film(seed: int, size_px: float) -> Float:
    """Return a smooth displacement (2, H, W), px, of 1 px in each direction (1 σ)."""
    noise = np.random.default_rng(seed).standard_normal((2, 300, 400))
    smooth = np.stack([gaussian_filter(n, size_px) for n in noise])
    return smooth / smooth.std()


def behind(measured: Measurements, displacement: Float) -> tuple[Measurements, float]:
    """Return what is measured behind a film, and the 1 σ, mm, by which the line is displaced.

    A mean and first harmonic around the pipe are not counted: they move scale and pose.
    """
    camera = measured.probe.camera

    def at(uv: Float) -> Float:
        return np.stack([map_coordinates(d, uv[:, ::-1].T, order=1, mode="nearest") for d in displacement], 1)

    tracks, rings = measured.tracks, measured.rings
    ring_uv = camera.project(rings.xyz_c).uv
    outward = (ring_uv - camera.centre_px) / np.linalg.norm(ring_uv - camera.centre_px, axis=1)[:, None]
    along_px = np.sum(at(ring_uv) * outward, 1)
    moved = rings.by_pixel * along_px[:, None]
    behind_it = replace(
        measured,
        tracks=replace(tracks, uv=tracks.uv + at(tracks.uv)),
        rings=replace(rings, xyz_c=rings.xyz_c + moved),
    )
    line_mm = np.linalg.norm(rings.by_pixel, axis=1) * along_px
    around = np.column_stack([np.ones(len(outward)), outward])
    fit = np.linalg.lstsq(around, line_mm, rcond=None)[0]
    return behind_it, float(np.std(line_mm - around @ fit))


def with_waves(made: Scene, depth_mm: float, length_mm: float) -> Measurements:
    """Return what line and texture measure of the scene's wall with waves of this length, both ways."""
    measured, state = made.measured, made.truth

    def relief(s: Float, psi: Float) -> Float:
        return (
            depth_mm * np.sin(2 * np.pi * s / length_mm) * np.cos(round(2 * np.pi * RADIUS / length_mm) * psi)
        )

    tracks, rings = measured.tracks, measured.rings
    s, psi, radius = to_pipe(state.axis, state.xyz_p)
    dented = from_pipe(state.axis, s, psi, radius + relief(s, psi))
    project = measured.probe.camera.project
    T_cp = inverse(state.T_pc[tracks.frame])
    moved_px = [project(transform(T_cp, xyz[tracks.landmark])).uv for xyz in (state.xyz_p, dented)]
    s, psi, _ = to_pipe(state.axis, transform(state.T_pc[rings.frame], rings.xyz_c))
    outward = rings.xyz_c * [1, 1, 0] / np.linalg.norm(rings.xyz_c[:, :2], axis=1)[:, None]
    return replace(
        measured,
        tracks=replace(tracks, uv=tracks.uv + moved_px[1] - moved_px[0]),
        rings=replace(rings, xyz_c=rings.xyz_c + relief(s, psi)[:, None] * outward),
    )


@cache
def made(seed: int) -> Scene:
    return scene(FRAMES, LANDMARKS, noise=1.0, seed=seed, bins=72)


def compared(measured: Measurements, seed: int) -> WallTwice:
    return wall_twice(estimate_state(made(seed).truth, measured, MotionParameters()), measured, PATCH_MM)


@pytest.mark.parametrize(("seed", "size_px"), [(1, 12.0), (2, 25.0), (3, 40.0)])
def test_a_film_on_the_window_is_found_with_the_error_of_the_line(seed: int, size_px: float) -> None:
    measured, displaced_mm = behind(made(seed).measured, 0.3 * film(seed, size_px))
    found = compared(measured, seed)
    assert found.is_certain
    assert found.in_errors > 10
    assert displaced_mm / 2.5 < found.shared_mm < 2.5 * displaced_mm


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_alone_is_no_film(seed: int) -> None:
    found = compared(made(seed).measured, seed)
    assert abs(found.in_errors) < 3
    assert not found.is_certain
    assert found.shared_mm < 2 * found.noise_mm < 0.03


@pytest.mark.parametrize("length_mm", [12.0, 20.0, 40.0])
def test_relief_that_both_see_is_no_film(length_mm: float) -> None:
    """With rings farther from a landmark, waves of 40 mm counted by 6 standard errors."""
    assert compared(with_waves(made(2), 1.0, length_mm), 2).in_errors < 3


@pytest.mark.parametrize("waves", [2, 3, 4])
def test_a_sheet_of_laser_light_that_is_not_plane_is_found_with_its_whole_error(waves: int) -> None:
    """It moves the rings alone; seven tenths of the difference were taken for the line's share."""
    measured = made(1).measured
    rings, camera = measured.rings, measured.probe.camera
    u, v = (camera.project(rings.xyz_c).uv - camera.centre_px).T
    moved = 0.15 * np.cos(waves * np.arctan2(v, u))[:, None] * rings.by_pixel
    found = compared(replace(measured, rings=replace(rings, xyz_c=rings.xyz_c + moved)), 1)
    assert found.is_certain
    assert found.shared_mm == pytest.approx(np.sqrt(np.mean(np.sum(moved**2, 1))), rel=0.2)


def test_a_joint_half_a_ring_off_its_place_is_no_film() -> None:
    there = scene(FRAMES, LANDMARKS, noise=1.0, seed=1, bins=72, joint_mm=(3.0, 0.0))
    bore = ONE_BORE.with_joint(joint_at(FRAMES) + 0.6, (0.0, 0.0), 3.0)
    estimate = estimate_state(replace(there.truth, bore=bore), there.measured, MotionParameters())
    assert wall_twice(estimate, there.measured, PATCH_MM).in_errors < 2


def test_a_misfit_of_poses_that_changes_along_the_pipe_is_no_film() -> None:
    """Where poses followed a joint of 1 mm that was not known, the rest counted by 17 standard errors."""
    random = np.random.default_rng(0)
    span, azimuth = random.uniform(0, 300, 3000), random.uniform(-np.pi, np.pi, 3000)
    off = np.sin(span / 25) * (0.3 + 0.3 * np.cos(azimuth)) + 0.1 * random.standard_normal(3000)
    sigma = np.full(3000, 0.1)
    left = wt._beyond_pose(span, azimuth, off, sigma, wt._OF_POSE * RADIUS)
    assert wt._of_pairs(wt._on_cylinder(span, azimuth, RADIUS), left, sigma, PATCH_MM).in_errors < 3


def test_the_wall_at_an_edge_is_not_the_mean_of_both_sides() -> None:
    span, arc = np.meshgrid(np.arange(0, 60, 1.2), np.arange(0, 200, 4.4), indexing="ij")
    rings = np.stack([span.ravel(), arc.ravel(), 0 * arc.ravel()], 1)
    noise = 0.05 * np.random.default_rng(0).standard_normal(len(rings))
    place = np.stack([np.arange(0, 60, 0.5), np.full(120, 88.0), np.zeros(120)], 1)
    mean = wt._mean_near(place, rings, noise + 1.0 * (rings[:, 0] > 30.5), 2.3)
    known = np.isfinite(mean)
    assert known[np.abs(place[:, 0] - 30.5) > 3].all()
    np.testing.assert_allclose(mean[known], place[known, 0] > 30.5, atol=0.2)


def test_noise_of_the_rings_is_no_film() -> None:
    """Pairs that shared rings counted their noise by 10 standard errors and more."""
    random = np.random.default_rng(0)
    span, azimuth = random.uniform(0, 600, 6000), random.uniform(-np.pi, np.pi, 6000)
    place = wt._on_cylinder(span, azimuth, RADIUS)
    at, around = np.meshgrid(np.arange(0, 600, 1.2), np.linspace(-np.pi, np.pi, 72, endpoint=False))
    rings = wt._on_cylinder(at.ravel(), around.ravel(), RADIUS)
    line = wt._mean_near(place, rings, 0.2 * random.standard_normal(len(rings)), wt._BESIDE * PATCH_MM)
    known = np.isfinite(line)
    found = wt._of_pairs(place[known], line[known], np.full(known.sum(), 0.05), PATCH_MM)
    assert abs(found.in_errors) < 3


def test_sums_of_windows_add() -> None:
    one = WallTwice(1.0, 0.01, 4.0)
    both = one.with_more(one)
    assert both.shared_mm == pytest.approx(0.5, rel=0.01)
    assert both.noise_mm == pytest.approx(2**-0.25 * one.noise_mm)
    assert both.in_errors == pytest.approx(np.sqrt(2) * one.in_errors)


def test_a_difference_of_four_errors_is_stated_though_not_certain() -> None:
    """A film of 3.96 errors counted as none."""
    found = WallTwice(3.96, 1.0, 100.0)
    assert not found.is_certain
    assert found.shared_mm == pytest.approx(0.193, abs=0.001)
    assert WallTwice(0.9, 1.0, 100.0).shared_mm == 0


def test_no_landmarks_are_no_evidence() -> None:
    assert WallTwice().shared_mm == 0
    assert WallTwice().noise_mm == np.inf
    assert not WallTwice().is_certain


def test_the_trajectory_states_what_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    run = drawn_run(0.9 * np.arange(12), np.zeros(12))
    monkeypatch.setattr(WallTwice, "shared_mm", 0.125)
    monkeypatch.setattr(WallTwice, "is_certain", True)
    parameters = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8)
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, quiet_context())
    assert got.displaced_mm == 0.125
    assert got.displaced_for_certain
