"""A laser knocked during a run is distinguished from a step of the pipe, corrected, and reported."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.artefacts.motion import LaserKnock
from pipeline.geometry.axis import distance_along
from pipeline.instrument.laser import LaserSheet
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.motion import MotionParameters, estimate_motion
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.laser_knock import KnockTest, RingJump, find_jump, texture_breaks
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.rings import RingCircles, circles_in_rings
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.steady_laser import with_steady_laser
from stages.motion.windows.submaps import Window
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.drawn_run import RADIUS, DrawnRun, drawn_run
from tests.motion_scene import Scene, joint_at, probe, scene
from tests.quiet import quiet_context

FRAMES, LANDMARKS = 40, 250
BEHIND = FRAMES // 2
SHIFT_MM = 1.5
KNOCKED_PX = 1.3
"""Of a picture of 95 px per radian: 0.75° of tilt."""


@dataclass(frozen=True)
class SceneRun:
    """Stands in for `MeasuredRun`: the measurements of a scene whose laser was knocked by ``knock``."""

    made: Scene
    jump: RingJump
    bore: Bore = ONE_BORE
    knock: LaserKnock | None = None

    def __getattr__(self, name: str) -> Any:
        return {
            "ring_place": np.arange(FRAMES),
            "rings": SimpleNamespace(frame=np.arange(FRAMES)),
            "time_s": self.made.measured.time_s,
            "T_pc": self.made.truth.T_pc,
            "whole": Window(0, FRAMES),
        }[name]

    def start_mm(self, window: Window) -> float:
        return 0.0

    def knocked(self, knock: LaserKnock) -> SceneRun:
        return replace(self, knock=knock)

    def start(self, window: Window, measured: Measurements, parameters: MotionParameters) -> State:
        return replace(self.made.truth, bore=self.bore)

    def measured(self, window: Window, parameters: MotionParameters) -> Measurements:
        measured, rings = self.made.measured, self.made.measured.rings
        if self.knock is None:
            return measured
        flat = replace(measured.probe, laser=LaserSheet(22.0))  # as used for the scene's rings
        seen = flat.after(self.knock).laser.intersect(rings.xyz_c)
        xyz_c = np.where((rings.frame >= BEHIND)[:, None], seen, rings.xyz_c)
        return replace(measured, rings=replace(rings, xyz_c=xyz_c))


def ring_shifted(made: Scene, shift_mm: float) -> Scene:
    """Return a scene whose rings lie farther along x of C from the middle frame on."""
    rings = made.measured.rings
    move = shift_mm * (rings.frame >= BEHIND)[:, None] * np.array([1.0, 0, 0])
    return replace(made, measured=replace(made.measured, rings=replace(rings, xyz_c=rings.xyz_c + move)))


def knock_in(made: Scene, jump_mm: tuple[float, float, float]) -> KnockTest:
    """Return the result for a jump of the ring's centre and radius in the middle frame."""
    ring = made.measured.rings.xyz_c[made.measured.rings.frame == BEHIND]
    jump = RingJump.of(BEHIND, np.array(jump_mm), ring, made.measured.probe, joint_at(FRAMES), ONE_BORE)
    run = cast(MeasuredRun, SceneRun(made, jump))
    found = with_steady_laser(run, MotionParameters(match_bias_px=0.01), lambda: None)[1]
    assert found is not None
    return found


def knocked(run: DrawnRun, shift_px: float, first: int) -> DrawnRun:
    """Return a run in whose pictures from frame ``first`` on the line is moved along x."""
    moved = (shift_px * (run.rings.frame >= first))[:, None] * np.cos(run.rings.azimuth_rad)
    rings = replace(run.rings, radius_px=(run.rings.radius_px + moved).astype(np.float32))
    points = triangulate_rings(rings, run.probe, TriangulateParameters(), quiet_context())
    return replace(run, rings=rings, points=points)


def jump_in(run: DrawnRun) -> RingJump | None:
    circles = circles_in_rings(run.points)
    return find_jump(circles, run.T_pc[circles.frame, 2, 3], run.points, run.probe)


def test_a_jump_of_rings_that_texture_does_not_follow_is_a_knock() -> None:
    found = knock_in(ring_shifted(scene(FRAMES, LANDMARKS, noise=1.0), SHIFT_MM), (SHIFT_MM, 0, 0))
    assert found.certain
    tilt = SHIFT_MM / (RADIUS * RADIUS / 22.0)  # dr = r tan θ tan φ, tan θ = r / l
    assert found.knock.change[1] == pytest.approx(-tilt, rel=0.1)


def test_a_knock_is_found_although_rings_show_only_a_part_of_it_at_first() -> None:
    """A knock that takes longer than one ring, as in a recording of another renderer, jumps by less."""
    found = knock_in(ring_shifted(scene(FRAMES, LANDMARKS, noise=1.0), SHIFT_MM), (0.4 * SHIFT_MM, 0, 0))
    assert found.certain


@pytest.mark.parametrize("joint_mm", [(0.0, SHIFT_MM), (SHIFT_MM, 0.0)])
def test_a_step_of_the_pipe_is_not_taken_for_a_knock(joint_mm: tuple[float, float]) -> None:
    """The rings jump as much as by a knock, but so do the landmarks behind the joint."""
    wider, aside = joint_mm
    found = knock_in(scene(FRAMES, LANDMARKS, noise=1.0, joint_mm=joint_mm), (aside, 0, wider))
    assert not found.certain
    assert not found.ambiguous


def test_a_jump_that_texture_cannot_decide_is_reported_as_a_jump() -> None:
    told: list[str] = []
    context = replace(quiet_context(), warn=told.append)
    ring, instrument = 50.0 * np.array([[1, 0, 0.44], [0, 1, 0.44], [-1, 0, 0.44], [0, -1, 0.44]]), probe()
    jump = RingJump.of(7, np.array([0.5, 0, 0]), ring, instrument, 30.0, ONE_BORE)
    for better in (-50.0, 2.0, 50.0):
        KnockTest(jump.guess, better, jump, 1.0).warn(context)
    assert ["does not show clearly" in words for words in told] == [True, False]
    assert "knocked relative to each other, by" in told[1]
    wider = replace(jump, jump_mm=np.array([0.1, 0, 0.9]))
    KnockTest(wider.guess, 50.0, wider, 1.0).warn(context)
    assert ["or the picture's scale changed" in words for words in told] == [False, False, True]


@cache
@pytest.mark.parametrize(("lost", "breaks"), [(25, True), (27, True), (23, False), (29, False)])
def test_where_texture_is_lost_beside_a_jump_no_knock_is_reported(lost: int, breaks: bool) -> None:
    """Two runs joined were reported as a laser knocked by 0.82 ± 0.03 degrees."""
    lit = np.arange(1, 60, 2)
    poses = TrackedPoses(lit, np.tile(np.eye(3, 4), (len(lit), 1, 1)), lit == lost)
    jump = RingJump(26, np.array([2.0, 0, 0]), np.eye(3), 37.0, ONE_BORE)
    assert texture_breaks(jump, lit - 1, poses) == breaks


def swaying() -> DrawnRun:
    """Return a run that sways and rotates."""
    return drawn_run(0.9 * np.arange(100), 0.004 * np.arange(100))


def test_rings_of_a_swaying_run_do_not_jump() -> None:
    assert jump_in(swaying()) is None
    found = jump_in(knocked(swaying(), KNOCKED_PX, 50))
    assert found is not None
    assert found.frame == 50


def test_a_swaying_run_does_not_jump_where_rings_are_missing() -> None:
    """Every tenth frame was withheld for a twin: over the wider gap a linear extrapolation is worse."""
    run = swaying()
    frame = np.setdiff1d(np.arange(100), np.arange(5, 100, 10))
    sway = 1.5 * np.sin(2 * np.pi * np.stack([frame / 40, frame / 31 + 0.2], 1))
    radius = 50 + 0.002 * np.random.default_rng(1).standard_normal(len(frame))
    circles = RingCircles(frame, sway, radius)
    assert find_jump(circles, 0.9 * frame, run.points, run.probe) is None
    leapt = replace(circles, centre_c=sway + 0.5 * (frame >= 56)[:, None])
    found = find_jump(leapt, 0.9 * frame, run.points, run.probe)
    assert found is not None
    assert found.frame == 56


def test_a_weld_is_not_a_jump() -> None:
    run = swaying()
    weld = 2.0 * ((run.rings.frame >= 48) & (run.rings.frame < 54))[:, None]
    rings = replace(run.rings, radius_px=(run.rings.radius_px - weld).astype(np.float32))
    points = triangulate_rings(rings, run.probe, TriangulateParameters(), quiet_context())
    assert jump_in(replace(run, rings=rings, points=points)) is None


def test_radii_and_distance_of_a_knocked_run_are_within_their_sigma() -> None:
    """Without correction, rings off by half a degree shorten the distance and dent the wall."""
    run, told = knocked(swaying(), KNOCKED_PX, 50), []
    parameters = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8)
    context = replace(quiet_context(), warn=told.append)
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, context)
    assert any("knocked" in words and "frame 50" in words for words in told)
    way, true = (np.ptp(z) for z in (distance_along(got.axis, got.T_pc), run.T_pc[:, 2, 3]))
    assert abs(way - true) < 2 * got.distance_sigma_mm
    chosen = AccumulateParameters(azimuth_samples=180)
    wall = accumulate_wall(run.probe, run.rings, run.points, got, chosen, quiet_context()).radius_map
    error = np.abs(wall.radius_mm - RADIUS) / wall.sigma_mm
    assert np.mean(error[np.isfinite(error)] < 1.96) > 0.93
