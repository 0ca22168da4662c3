"""A drift of the image scale is distinguished from a pipe that widens, removed, and reported."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest

from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import Displaced
from pipeline.export.run_record import mean_diameter
from pipeline.geometry.axis import straight_axis
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.motion import MotionParameters, estimate_motion
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.bundle_adjustment.image_scale import ScaleDrift, drift_of_scale
from stages.motion.bundle_adjustment.solver import Estimate, estimate_state
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.windows.steady_scale import SteadyRun, with_steady_scale
from stages.motion.windows.submaps import Window
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.drawn_run import RADIUS, DrawnRun, drawn_run
from tests.motion_scene import Scene, scene
from tests.quiet import quiet_context
from tests.ring_images import MemorySource
from tests.unit.growing_run import GROWS, WHOLE, textured

FRAMES, LANDMARKS = 60, 500
PARAMETERS = MotionParameters(match_bias_px=0.01)
REDUCER = replace(ONE_BORE, rings_mm=np.arange(2.0), rings_wider_mm=np.arange(2.0))


@cache
def adjusted(**changes: float) -> tuple[Scene, Estimate]:
    """Return a scene and its adjustment; both are cached, and no test changes them."""
    made = scene(FRAMES, LANDMARKS, noise=1.0, **changes)
    return made, estimate_state(made.truth, made.measured, PARAMETERS)


def drift_in(**changes: float) -> tuple[ScaleDrift, list[str]]:
    made, estimate = adjusted(**changes)
    drift, told = drift_of_scale(estimate, made.measured), []
    drift.warn(replace(quiet_context(), warn=told.append), corrected=True)
    return drift, told


def seen_growing(run: DrawnRun, grows: float) -> DrawnRun:
    """Return a run whose pictures are larger at the end than at the start by the share ``grows``."""
    count, source = len(run.T_pc), run.recording.source
    larger = 1 + grows * (np.arange(count) / (count - 1) - 0.5)
    assert isinstance(source, MemorySource)
    centre, images = run.probe.camera.centre_px, {}
    for k, image in source.images.items():
        move = np.column_stack([larger[k] * np.eye(2), (1 - larger[k]) * centre])
        images[k] = cv2.warpAffine(image, move, image.shape[1::-1], flags=cv2.INTER_CUBIC)
    rings = run.rings.reduced(1 / larger[run.rings.frame])
    points = triangulate_rings(rings, run.probe, TriangulateParameters(), quiet_context())
    recording = replace(run.recording, source=MemorySource(images, run.probe.camera.image_size))
    return replace(run, recording=recording, rings=rings, points=points)


@pytest.mark.parametrize("grows", [GROWS, -GROWS])
def test_a_growing_picture_is_reported_with_its_size(grows: float) -> None:
    drift, told = drift_in(picture_grows=grows)
    found = drift.at_frames[-1] - drift.at_frames[0]
    assert drift.certain
    assert abs(found - grows) < 3 * 2 * drift.sigma[-1] + 0.1 * GROWS  # one step of linear equations
    assert any(("grows" if grows > 0 else "shrinks") in words for words in told)


@pytest.mark.parametrize("widens", [0.0, 0.01])
def test_a_pipe_that_widens_is_not_taken_for_a_growing_picture(widens: float) -> None:
    drift, told = drift_in(widens=widens)
    assert drift.p_steady > 1e-3
    assert not drift.ambiguous
    assert told == []


def test_a_small_change_of_the_rings_may_be_either() -> None:
    drift, _ = drift_in(widens=0.002)
    assert drift.ambiguous
    assert np.ptp(drift.stated_sigma) * drift.ring_mm > 0.05


def steady_run(bore: Bore, lost: float, **changes: float) -> SteadyRun:
    """Return the result for the image scale of a run in a ``bore`` with so many lit pictures ``lost``."""
    made, estimate = adjusted(**changes)
    poses = TrackedPoses(np.arange(FRAMES), made.truth.T_pc, np.arange(FRAMES) < lost * FRAMES)
    run = SimpleNamespace(bore=bore, whole=None, image_scale=None, texture=textured(poses))
    run.time_s = made.measured.time_s
    part_of_run, nobody = Window(0, FRAMES), cast(Any, None)
    return with_steady_scale(cast(Any, run), part_of_run, estimate, made.measured, PARAMETERS, nobody)


@pytest.mark.parametrize("changes", [{"picture_grows": GROWS}, {"widens": 0.002}], ids=["grows", "either"])
def test_in_a_reducer_no_drift_is_reported(changes: dict[str, float]) -> None:
    """Rings and texture differ from each other there as they do where the picture grows."""
    for bore, told in ((ONE_BORE, True), (REDUCER, False)):
        steady = steady_run(bore, 0.0, **changes)
        assert (steady.drift.certain or steady.drift.ambiguous) == told
        assert (steady.scale_sigma is not None) == told


def test_without_texture_a_growing_picture_may_be_a_pipe_that_widens() -> None:
    """Of 85 lit pictures 84 showed no texture, and the picture was reported to grow by 8 %."""
    seen, lost = (steady_run(ONE_BORE, share, picture_grows=GROWS) for share in (0.1, 0.9))
    assert seen.drift.certain
    assert not lost.drift.certain
    assert lost.drift.ambiguous
    assert lost.scale_sigma is not None


def test_an_encoder_whose_scale_changes_is_not_a_picture_that_shrinks() -> None:
    """One that was .2 s early made "the picture shrink by 1.34 %", and "no lens changes so much"."""
    made = scene(FRAMES, LANDMARKS, noise=2.0)
    sound, share = made.measured.encoder, np.arange(FRAMES) / FRAMES
    assert sound is not None
    creeps = replace(sound, distance_mm=sound.distance_mm * (1 + 0.03 * share), sigma_mm=0.015)
    measured = replace(made.measured, encoder=creeps)
    estimate = estimate_state(made.truth, measured, PARAMETERS)
    assert drift_of_scale(estimate, measured).certain, "control: with the encoder it seems so"
    poses = TrackedPoses(np.arange(FRAMES), made.truth.T_pc, np.zeros(FRAMES, bool))
    run = SimpleNamespace(bore=ONE_BORE, whole=WHOLE, image_scale=None, texture=textured(poses))
    part, nobody, told = Window(0, FRAMES), cast(Any, None), list[str]()
    steady = with_steady_scale(cast(Any, run), part, estimate, measured, PARAMETERS, nobody)
    assert not steady.drift.certain
    steady.warn(replace(quiet_context(), warn=told.append))
    assert len(told) == 1
    assert "or the encoder's does" in told[0]


@pytest.mark.parametrize(("course", "told"), [((-1, 0.5, 1), True), ((-1, 1, -0.5), False)])
def test_a_drift_goes_in_one_direction(course: tuple[float, ...], told: bool) -> None:
    """Grooves of a gauge gave a course up and down in a sound probe, 6 σ from a constant scale."""
    drift = drift_in()[0]
    assert not drift.certain
    assert replace(drift, at_frames=GROWS * np.array(course), p_steady=1e-9).certain == told


def test_a_course_that_no_lens_can_have_is_reported_with_other_causes() -> None:
    drift, told = drift_in(picture_grows=GROWS)[0], []
    context = replace(quiet_context(), warn=told.append)
    for times in (1.0, 10.0):
        replace(drift, at_frames=times * drift.at_frames).warn(context, corrected=times == 1.0)
    assert ["water" in words for words in told] == [False, True]
    assert "No lens changes so much" in told[1]


def test_a_step_of_the_bore_may_explain_the_rings() -> None:
    made, estimate = adjusted(widens=0.002)
    plain = drift_of_scale(estimate, made.measured)
    middle = float(np.median(made.truth.T_pc[:, 2, 3]))
    bore = Bore(np.array([middle + 20.0]), np.zeros(2))
    state = replace(estimate.state, bore=bore)
    stepped = drift_of_scale(
        replace(estimate, adjusted=replace(estimate.adjusted, state=state)), made.measured
    )
    assert stepped.sigma[-1] > plain.sigma[-1]


def test_radii_with_a_growing_picture_are_within_their_sigma() -> None:
    """Without correction the radii of rings change by 1.1 mm, with 0.02 mm stated."""
    k = np.arange(150)
    run, told = seen_growing(drawn_run(0.9 * k, 0.004 * k), 0.008), []
    parameters = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8)
    context = replace(quiet_context(), warn=told.append)
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, context)
    assert any("the picture grows" in words for words in told)
    chosen = AccumulateParameters(azimuth_samples=180)
    wall = accumulate_wall(run.probe, run.rings, run.points, got, chosen, quiet_context()).radius_map
    radius, sigma = (np.nanmedian(part, 1) for part in (wall.radius_mm, wall.sigma_mm))
    seen = np.isfinite(radius)
    assert np.ptp(radius[seen]) < 0.4
    assert np.mean(np.abs(radius - RADIUS)[seen] < 1.96 * sigma[seen]) > 0.93


def test_the_estimated_scale_is_used_for_the_radii() -> None:
    run = drawn_run(0.9 * np.arange(40), np.zeros(40))
    axis, count = straight_axis(-50.0, 150.0), 40
    plain = Trajectory(
        np.arange(count), np.arange(count) / 30, run.T_pc, np.zeros((count, 6, 6)), axis, RADIUS, 1, 0, 0, ()
    )
    scale = 1 + 0.01 * (np.arange(count) / count - 0.5)
    known = replace(plain, image_scale=scale, image_scale_sigma=np.full(count, 2e-3))
    rings = run.rings.reduced(1 / scale[run.rings.frame])
    chosen = AccumulateParameters(azimuth_samples=180)
    walls = [
        accumulate_wall(run.probe, r, run.points, t, chosen, quiet_context()).radius_map
        for r, t in ((run.rings, plain), (rings, known))
    ]
    assert np.nanmax(np.abs(walls[0].radius_mm - walls[1].radius_mm)) < 0.02
    gain = np.nanmedian(walls[1].sigma_mm ** 2 - walls[0].sigma_mm ** 2) ** 0.5
    theta = np.arctan2(RADIUS, 22.0)  # dr = b (1 + tan² θ) θ dε where the radius in the picture is f θ
    assert gain == pytest.approx(22.0 / np.cos(theta) ** 2 * theta * 2e-3, rel=0.05)
    doubted = accumulate_wall(
        run.probe, run.rings, run.points, replace(plain, radius_doubt=0.02), chosen, quiet_context()
    ).radius_map
    gain = np.nanmedian(doubted.sigma_mm**2 - walls[0].sigma_mm ** 2) ** 0.5
    assert gain == pytest.approx(0.02 * RADIUS, rel=0.01), "a probe that encoder and diameter contradict"


@pytest.mark.parametrize(
    ("displaced_mm", "certain", "warned"),
    [(0.0, False, False), (0.001, True, False), (0.2, True, True), (0.2, False, False)],
)
def test_a_picture_displaced_smoothly_widens_sigma_and_is_told_if_that_matters(
    displaced_mm: float, certain: bool, warned: bool
) -> None:
    """Behind a film of water 56 % of the 95 % intervals held, and the cause was not named."""
    run, told = drawn_run(0.9 * np.arange(40), np.zeros(40)), list[str]()
    got = Trajectory(
        np.arange(40), np.arange(40) / 30, run.T_pc, np.zeros((40, 6, 6)), straight_axis(-50.0, 150.0),
        RADIUS, 1, 0, 0, (), displaced=(Displaced(0, 39, displaced_mm, certain),),
    )  # fmt: skip
    context = replace(quiet_context(), warn=told.append)
    chosen = AccumulateParameters(azimuth_samples=180)
    wall = accumulate_wall(run.probe, run.rings, run.points, got, chosen, context)
    sigma_mm, random_mm = wall.radius_map.sigma_mm, wall.radius_map.sigma_random_mm
    systematic = np.nanmedian(sigma_mm**2 - random_mm**2) ** 0.5
    assert np.all(wall.radius_map.displaced_mm == displaced_mm), "depths of defects include it"
    calibration = accumulate_wall(
        run.probe, run.rings, run.points, replace(got, displaced=()), chosen, quiet_context()
    ).radius_map
    assert mean_diameter(wall.radius_map)[1] == pytest.approx(mean_diameter(calibration)[1], rel=1e-3)
    assert np.nanmean(wall.radius_map.common_variance()) ** 0.5 == pytest.approx(
        np.nanmean(calibration.common_variance()) ** 0.5, rel=1e-3
    )
    assert systematic >= 0.999 * displaced_mm
    about = [words for words in told if "photo and laser line contradict each other" in words]
    assert len(about) == warned
    assert all("a sheet of laser light" in words and "in frames 0 to 39" in words for words in about)
