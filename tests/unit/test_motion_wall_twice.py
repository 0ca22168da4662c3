"""Smooth displacements of the picture are found where texture and line show one wall at different radii."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from pipeline.arrays import Float
from pipeline.artefacts.motion import Displaced
from pipeline.geometry.axis import from_pipe, to_pipe
from pipeline.geometry.rigid import inverse, transform
from stages.motion import MotionParameters, estimate_motion
from stages.motion.bore import ONE_BORE
from stages.motion.bundle_adjustment import wall_twice as wt
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.shared_difference import Shared, WallTwice
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.bundle_adjustment.wall_twice import wall_twice
from stages.motion.trajectory import displaced_in
from stages.motion.windows.sliding_window import _End
from stages.motion.windows.submaps import Window
from tests.drawn_run import drawn_run
from tests.motion_scene import RADIUS, Scene, joint_at, scene
from tests.quiet import quiet_context

PATCH_MM, SECTORS, VIEW_MM = 4.6, 28, 1.07 * RADIUS
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
    return wall_twice(
        estimate_state(made(seed).truth, measured, MotionParameters()), measured, PATCH_MM, VIEW_MM
    )


def in_errors(found: WallTwice) -> float:
    return max(found.on_wall.in_errors, found.on_window.in_errors)


def summed(span: Float, azimuth: Float, difference: Float, sigma: Float) -> WallTwice:
    """Return the sums over differences (L,) for a probe that does not roll, with a ring every millimetre."""
    place, part = wt._on_cylinder(span, azimuth, RADIUS), (span / PATCH_MM).astype(int)
    return wt._summed(
        wt._Compared(place, difference, sigma, part, np.rint(span).astype(int), azimuth), PATCH_MM, SECTORS
    )


def watered(random: np.random.Generator, wet: slice, film_mm: float, length: int = 1000) -> WallTwice:
    """Return the sums over noise of .1 mm, and a film that displaces the line in a stretch, mm."""
    span, azimuth = random.uniform(0, length, 8 * length), random.uniform(-np.pi, np.pi, 8 * length)
    waves = film_mm * np.cos(5 * azimuth) * np.sqrt(2) * ((span >= wet.start) & (span < wet.stop))
    return summed(span, azimuth, waves + 0.1 * random.standard_normal(len(span)), np.full(len(span), 0.1))


@pytest.mark.parametrize(("seed", "size_px"), [(1, 12.0), (2, 25.0), (3, 40.0)])
def test_a_film_on_the_window_is_found_with_the_error_of_the_line(seed: int, size_px: float) -> None:
    measured, displaced_mm = behind(made(seed).measured, 0.3 * film(seed, size_px))
    found = compared(measured, seed)
    assert found.is_certain
    assert found.on_wall.in_errors > 10
    assert displaced_mm / 2.5 < found.size_mm < 2.5 * displaced_mm


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_alone_is_no_film(seed: int) -> None:
    found = compared(made(seed).measured, seed)
    assert abs(found.on_wall.in_errors) < 3
    assert abs(found.on_window.in_errors) < 3
    assert not found.is_certain
    assert found.size_mm < 2 * found.noise_mm < 0.03
    assert len(found.stretches()) == 1


@pytest.mark.parametrize("length_mm", [12.0, 20.0, 40.0])
def test_relief_that_both_see_is_no_film(length_mm: float) -> None:
    """With rings farther from a landmark, waves of 40 mm counted by 6 standard errors."""
    assert in_errors(compared(with_waves(made(2), 1.0, length_mm), 2)) < 3


@pytest.mark.parametrize("waves", [2, 3, 4])
def test_a_sheet_of_laser_light_that_is_not_plane_is_found_with_its_whole_error(waves: int) -> None:
    """It moves the rings alone; seven tenths of the difference were taken for the line's share."""
    measured = made(1).measured
    rings, camera = measured.rings, measured.probe.camera
    u, v = (camera.project(rings.xyz_c).uv - camera.centre_px).T
    moved = 0.15 * np.cos(waves * np.arctan2(v, u))[:, None] * rings.by_pixel
    found = compared(replace(measured, rings=replace(rings, xyz_c=rings.xyz_c + moved)), 1)
    assert found.is_certain
    assert found.size_mm == pytest.approx(np.sqrt(np.mean(np.sum(moved**2, 1))), rel=0.2)


def test_a_joint_half_a_ring_off_its_place_is_no_film() -> None:
    there = scene(FRAMES, LANDMARKS, noise=1.0, seed=1, bins=72, joint_mm=(3.0, 0.0))
    bore = ONE_BORE.with_joint(joint_at(FRAMES) + 0.6, (0.0, 0.0), 3.0)
    estimate = estimate_state(replace(there.truth, bore=bore), there.measured, MotionParameters())
    assert in_errors(wall_twice(estimate, there.measured, PATCH_MM, VIEW_MM)) < 2


def test_a_misfit_of_poses_that_changes_along_the_pipe_is_no_film() -> None:
    """Where poses followed a joint of 1 mm that was not known, the rest counted by 17 standard errors."""
    random = np.random.default_rng(0)
    span, azimuth = random.uniform(0, 300, 3000), random.uniform(-np.pi, np.pi, 3000)
    off = np.sin(span / 25) * (0.3 + 0.3 * np.cos(azimuth)) + 0.1 * random.standard_normal(3000)
    sigma = np.full(3000, 0.1)
    left = wt._beyond_pose(span, azimuth, off, sigma, wt._OF_VIEW * VIEW_MM)
    assert in_errors(summed(span, azimuth, left, sigma)) < 3


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
    found = summed(span[known], azimuth[known], line[known], np.full(known.sum(), 0.05))
    assert abs(found.on_wall.in_errors) < 3
    assert abs(found.on_window.in_errors) < 3


@pytest.mark.parametrize("wet", [slice(0, 100), slice(450, 550), slice(900, 1000)])
def test_a_film_in_a_tenth_of_a_run_is_stated_there_with_its_whole_size(wet: slice) -> None:
    """One number for the run stated .032 mm for a film of .1 mm."""
    found = watered(np.random.default_rng(1), wet, 0.1)
    assert found.size_mm < 0.05, "control: as a mean over the run"
    stretches = found.stretches()
    (film,) = (s for s in stretches if s.is_certain)
    assert film.size_mm == pytest.approx(0.1, rel=0.15)
    assert film.frame[[0, -1]] == pytest.approx([wet.start, wet.stop], abs=2 * PATCH_MM)
    assert all(s.size_mm < 0.03 for s in stretches if s is not film)


def test_noise_is_one_stretch() -> None:
    runs = [watered(np.random.default_rng(seed), slice(0, 0), 0.0, 200) for seed in range(30)]
    assert {len(r.stretches()) for r in runs} == {1}
    assert np.mean([r.size_mm for r in runs]) < 0.01


def test_a_film_too_faint_for_neighbours_shows_at_its_place_of_the_window() -> None:
    """On open-3 a film of 1 px was not found for lack of texture."""
    found = watered(np.random.default_rng(2), slice(0, 1000), 0.015)
    assert found.on_wall.in_errors < 5
    assert found.is_certain
    assert found.size_mm == pytest.approx(0.015, rel=0.2)


def test_what_two_windows_share_counts_once() -> None:
    """Standard errors of the overlap were too small by √2."""
    whole = watered(np.random.default_rng(3), slice(0, 1000), 0.1)
    windows = (Window(0, 600), Window(400, 1000))
    ends = []
    for k, window in enumerate(windows):
        part = whole.between(window.first, window.last).later(-window.first)
        ends.append(_End(1, True, 0.1, 1.0, 0.1, part).in_run(windows, k).wall_twice)
    joined = WallTwice.joined(ends)
    np.testing.assert_array_equal(joined.frame, whole.frame)
    assert joined.on_wall == whole.on_wall
    assert joined.on_window == whole.on_window


def test_a_difference_of_four_errors_is_stated_though_not_certain() -> None:
    """A film of 3.96 errors counted as none."""
    found = Shared(3.96, 1.0, 100.0)
    assert found.size_mm == pytest.approx(0.193, abs=0.001)
    assert Shared(0.9, 1.0, 100.0).size_mm == 0


def test_no_landmarks_are_no_evidence() -> None:
    none = WallTwice.joined([WallTwice.none()])
    assert none.size_mm == 0
    assert none.noise_mm == np.inf
    assert not none.is_certain
    assert displaced_in(none, np.arange(5)) == (Displaced(0, 4, 0.0, False),)


def test_stretches_cover_all_frames_of_a_trajectory() -> None:
    found = displaced_in(watered(np.random.default_rng(1), slice(450, 550), 0.1), 2 * np.arange(1001))
    assert (found[0].frame_from, found[-1].frame_to) == (0, 2000)
    assert [b.frame_from - a.frame_to for a, b in pairwise(found)] == [2] * (len(found) - 1)


def test_the_trajectory_states_what_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    run = drawn_run(0.9 * np.arange(12), np.zeros(12))
    monkeypatch.setattr(WallTwice, "size_mm", 0.125)
    monkeypatch.setattr(WallTwice, "is_certain", True)
    parameters = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8)
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, quiet_context())
    assert got.displaced == (Displaced(0, 11, 0.125, True),)
    np.testing.assert_array_equal(got.displaced_mm(np.arange(12)), 0.125)
