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
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.bundle_adjustment.wall_twice import WallTwice, wall_twice
from tests.drawn_run import drawn_run
from tests.motion_scene import RADIUS, Scene, scene
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
    assert found.in_errors > 10
    assert displaced_mm / 2.5 < found.line_mm < 2.5 * displaced_mm


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_alone_is_no_film(seed: int) -> None:
    found = compared(made(seed).measured, seed)
    assert abs(found.in_errors) < 3
    assert found.line_mm == 0


@pytest.mark.parametrize("length_mm", [12.0, 20.0, 40.0])
def test_relief_that_both_see_is_no_film(length_mm: float) -> None:
    """With rings farther from a landmark, waves of 40 mm counted by 6 standard errors."""
    assert compared(with_waves(made(2), 1.0, length_mm), 2).in_errors < 3


def test_sums_of_windows_add() -> None:
    one = WallTwice(1.0, 0.01, 4.0)
    both = one.with_more(one)
    assert both.shared_mm == pytest.approx(0.5)
    assert both.in_errors == pytest.approx(np.sqrt(2) * one.in_errors)


def test_no_landmarks_are_no_evidence() -> None:
    assert WallTwice().line_mm == 0


def test_the_trajectory_states_what_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    run = drawn_run(0.9 * np.arange(12), np.zeros(12))
    monkeypatch.setattr(WallTwice, "line_mm", 0.125)
    parameters = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8)
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, quiet_context())
    assert got.displaced_mm == 0.125
