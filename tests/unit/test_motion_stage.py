"""The whole motion stage on drawn recordings: poses within σ, and no result where nothing can be seen."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context
from pipeline.recording.base import Illumination
from stages.motion import MotionParameters, adjust_at_once, estimate_motion, measure_run
from stages.motion.bundle_adjustment import residuals
from stages.motion.estimate import require_along_pipe
from stages.motion.tracking.matched import Matched
from stages.motion.tracking.patches import cut
from stages.motion.tracking.strips import Hidden, Strip, StripGrid
from stages.motion.tracking.tracker import TextureTracker
from stages.premises.stays import find_static_places
from tests.drawn_run import BASELINE, RADIUS, DrawnRun, drawn_run, small_probe, without_encoder
from tests.quiet import quiet_context
from tests.ring_images import MemorySource

STEP = 0.8
PARAMETERS = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8)


def estimated(run: DrawnRun, context: Context | None = None, **parameters: int) -> Trajectory:
    chosen, context = PARAMETERS.model_copy(update=parameters), context or quiet_context()
    return estimate_motion(run.recording, run.probe, run.rings, run.points, chosen, context)


def errors(got: Trajectory, run: DrawnRun) -> tuple[Float, Float, Float]:
    """Return distance (mm) and roll (rad) errors since the first frame, and their 1 σ (N, 2)."""
    z = got.T_pc[:, 2, 3] - run.T_pc[:, 2, 3]
    roll = roll_of(got.T_pc) - roll_of(run.T_pc)
    return z - z[0], roll - roll[0], np.sqrt(np.diagonal(got.covariance, axis1=1, axis2=2)[:, [2, 5]])


def roll_of(T: Float) -> Float:
    return np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0]))


@pytest.fixture(scope="module")
def steady() -> DrawnRun:
    k = np.arange(36)
    return drawn_run(STEP * k, 0.004 * k)


def test_the_report_includes_the_unknown_distance_at_a_cut(steady: DrawnRun) -> None:
    """The report was made earlier, with σ of a run without cuts."""
    told: dict[str, object] = {}
    context = replace(quiet_context(), report=lambda name, value, unit="": told.update({name: value}))
    run = steady
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, PARAMETERS, context, (18,))
    assert told["1 σ of distance at the end"] == got.distance_sigma_mm
    assert got.distance_sigma_mm > STEP * 35
    along = np.sqrt(got.covariance[:, 2, 2])
    assert along[17] < 1.0
    assert along[18] > STEP * 35 - 0.1


@pytest.mark.parametrize("encoder", [True, False])
def test_poses_are_within_their_sigma(steady: DrawnRun, encoder: bool) -> None:
    run = steady if encoder else without_encoder(steady)
    got = estimated(run)
    z, roll, sigma = errors(got, run)
    assert abs(z[-1]) < 3 * sigma[-1, 0] + 0.02
    assert abs(roll[-1]) < 3 * sigma[-1, 1] + 1e-3
    assert sigma[-1, 0] < 0.02 * STEP * 36
    assert got.radius_mm == pytest.approx(50, abs=0.05)
    assert np.isfinite(got.encoder_scale) == encoder
    assert got.events == ()


def reducer(s: Float, psi: Float) -> Float:
    return RADIUS * (1 - 0.15 * np.clip((s - 45) / 20, 0, 1)) + 0 * psi


@pytest.fixture(scope="module")
def reduced() -> DrawnRun:
    k = np.arange(64)
    return drawn_run(STEP * k, 0.004 * k, radius_at=reducer)


@pytest.mark.parametrize("encoder", [True, False])
def test_a_reducer_is_reported_and_nothing_else_is_blamed(reduced: DrawnRun, encoder: bool) -> None:
    """Taken for one bore, distance was 6 mm off, and encoder and lens were blamed."""
    run = reduced if encoder else without_encoder(reduced)
    told: list[str] = []
    got = estimated(run, replace(quiet_context(), warn=told.append))
    z, roll, sigma = errors(got, run)
    assert abs(z[-1]) < 3 * sigma[-1, 0]
    assert 0.2 < sigma[-1, 0] < 0.02 * STEP * 64, "σ includes the error of texture on a slope"
    assert abs(roll[-1]) < 3 * sigma[-1, 1] + 1e-3
    assert len(told) == 1
    assert "width changes by 15.0 mm" in told[0]
    moved = np.linalg.pinv(run.probe.principal_uncertainties()) @ (got.instrument - run.probe.parameters)
    assert np.abs(moved).max() < 0.03, "texture on a slope does not change the probe: it had, by 8 σ"
    np.testing.assert_array_equal(got.instrument_covariance, run.probe.covariance)


def test_distances_through_a_reducer_include_the_sigma_of_the_stated_probe(reduced: DrawnRun) -> None:
    """The probe is held there: with a baseline of 2 σ too long, distance was wrong by 8 of its σ."""
    run, sigma_mm = without_encoder(reduced), 0.02 * BASELINE
    stated, covariance = run.probe.parameters.copy(), run.probe.covariance.copy()
    stated[8] += 2 * sigma_mm
    covariance[8, 8] = sigma_mm**2
    got = estimated(replace(run, probe=run.probe.with_parameters(stated, covariance)))
    z, _, sigma = errors(got, run)
    assert abs(z[-1]) < 3 * sigma[-1, 0]
    assert got.scale_sigma == pytest.approx(0.02, rel=0.3)


@pytest.mark.parametrize("wrong", [1.0, 1.05])
def test_an_encoder_with_another_scale_is_reported_and_does_not_pull_distances(
    steady: DrawnRun, wrong: float
) -> None:
    """Its scale is stated to .2 %: at 5 %, distance followed it by 4 of its stated σ, without a message."""
    reading = steady.recording.encoder
    assert reading is not None
    encoder = replace(reading, distance_mm=wrong * reading.distance_mm)
    run = replace(steady, recording=replace(steady.recording, encoder=encoder))
    told: list[str] = []
    got = estimated(run, replace(quiet_context(), warn=told.append))
    z, _, sigma = errors(got, run)
    assert abs(z[-1]) < 3 * sigma[-1, 0]
    assert abs(got.encoder_scale * wrong - 1) < 3 * got.encoder_scale_sigma
    assert any("wheel" in words for words in told) == (wrong != 1)


def test_the_diagnosis_uses_the_same_distances_as_the_run(steady: DrawnRun) -> None:
    """Measured without the encoder and adjusted in one piece, a short run equals the result of the stage."""
    parts = steady.recording, steady.probe, steady.rings, steady.points, PARAMETERS, quiet_context()
    run = measure_run(*parts, use_encoder=False)
    assert run.encoder is None
    assert measure_run(*parts).encoder is not None, "control: it has an encoder"
    measured = run.measured(run.whole, PARAMETERS)
    start, frames = run.start(run.whole, measured, PARAMETERS), steady.recording.frames
    got = adjust_at_once(start, measured, frames, run.texture.grid.radius_mm, PARAMETERS, quiet_context())
    wanted = estimated(without_encoder(steady))
    assert got.trajectory.T_pc.tobytes() == wanted.T_pc.tobytes()
    assert got.trajectory.covariance.tobytes() == wanted.covariance.tobytes()
    assert got.trajectory.T_pc.tobytes() != estimated(steady).T_pc.tobytes(), (
        "control: the encoder makes a difference"
    )


def test_an_adjustment_that_departs_from_the_rings_is_refused(steady: DrawnRun) -> None:
    points = steady.recording, steady.probe, steady.rings, steady.points
    run = measure_run(*points, PARAMETERS, quiet_context(), use_encoder=False)
    measured = run.measured(run.whole, PARAMETERS)
    start, frames = run.start(run.whole, measured, PARAMETERS), steady.recording.frames
    with pytest.raises(UnusableError, match="does not converge"):
        adjust_at_once(start, measured, frames, 60.0, PARAMETERS, quiet_context())


def test_distance_and_roll_are_zero_at_the_first_camera(steady: DrawnRun) -> None:
    got = estimated(steady)
    assert got.T_pc[0, 2, 3] == pytest.approx(0, abs=0.005)  # not exactly 0, as the pipe bends a little
    assert roll_of(got.T_pc)[0] == pytest.approx(0, abs=1e-3)
    np.testing.assert_allclose(
        got.T_pc[:, :3, :3] @ np.swapaxes(got.T_pc[:, :3, :3], 1, 2),
        np.tile(np.eye(3), (36, 1, 1)),
        atol=1e-9,
    )


def test_the_same_recording_gives_the_same_bytes(steady: DrawnRun) -> None:
    first, second = estimated(steady), estimated(steady)
    assert first.T_pc.tobytes() == second.T_pc.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


@pytest.mark.parametrize("window", [800, 44])
def test_stop_and_reversal_are_followed_without_encoder(window: int) -> None:
    step = np.concatenate([np.full(14, STEP), np.zeros(28), np.full(14, -STEP), np.full(8, STEP)])
    step = np.convolve(np.pad(step, 4, mode="edge"), np.hanning(11)[1:-1] / 5, mode="valid")  # without jerks
    run = drawn_run(np.concatenate([[0], np.cumsum(step)]), np.zeros(len(step) + 1), encoder=False)
    got = estimated(run, window_frames=window, overlap_frames=20)
    z, _, sigma = errors(got, run)
    assert np.abs(z).max() < 0.1, (np.round(z, 2), np.round(sigma[:, 0], 3))
    assert {"stop", "reversal"} <= {e.kind for e in got.events}


def test_no_roll_is_found_on_a_plain_wall(steady: DrawnRun) -> None:
    k = np.arange(36)
    run = drawn_run(STEP * k, 0.004 * k, contrast=0.0)
    got = estimated(run)
    _, _, sigma = errors(got, run)
    known = errors(estimated(steady), steady)[2]
    found = roll_of(got.T_pc)
    assert abs(found[-1] - found[0]) < sigma[-1, 1], "nothing shows it"
    assert sigma[-1, 1] > 10 * known[-1, 1]
    assert sigma[-1, 1] > sigma[4, 1]
    assert abs(found[-1] - found[0] - 0.004 * 35) < 3 * sigma[-1, 1]


def test_a_probe_at_rest_gives_no_distance() -> None:
    run = drawn_run(np.zeros(24), np.zeros(24), encoder=False)
    got = estimated(run)
    assert np.ptp(got.T_pc[:, 2, 3]) < 0.1
    assert "stop" in {e.kind for e in got.events}


def test_a_run_with_neither_texture_nor_encoder_is_refused() -> None:
    run = drawn_run(STEP * np.arange(24), np.zeros(24), contrast=0.0, encoder=False)
    with pytest.raises(UnusableError, match="no encoder"):
        estimated(run)


def test_a_run_without_rings_is_refused(steady: DrawnRun) -> None:
    blind = np.full_like(steady.points.xyz_c, np.nan)
    points = type(steady.points)(**{**vars(steady.points), "xyz_c": blind})
    with pytest.raises(UnusableError, match="0 laser frames"):
        estimate_motion(steady.recording, steady.probe, steady.rings, points, PARAMETERS, quiet_context())


def test_burnt_in_text_is_not_tracked() -> None:
    k = np.arange(72)
    run = drawn_run(STEP * k, 0.004 * k, encoder=False)
    sign = np.sign(np.random.default_rng(3).standard_normal((20, 100))).astype(np.float32)
    sign = cv2.resize(sign, (300, 60), interpolation=cv2.INTER_NEAREST)
    assert isinstance(run.recording.source, MemorySource)
    for image in run.recording.source.images.values():
        assert image is not None
        image[200:260, 50:350] = np.where(sign > 0, 230, 15)
    followed = errors(estimated(run), run)[0][-1]
    told: list[str] = []
    context = replace(quiet_context(), warn=told.append)
    stays = find_static_places(run.recording, run.probe, run.recording.frames.of(Illumination.LED), context)
    assert "burnt-in" in told[0]
    z, _, sigma = errors(estimated(replace(run, recording=replace(run.recording, stays=stays))), run)
    assert abs(z[-1]) < 3 * sigma[-1, 0] + 0.02
    assert abs(followed) > 0.2 * STEP * k[-1], "control: text is tracked as if it were the wall"


@pytest.mark.parametrize(("turned_deg", "wrong"), [(30, False), (80, True)])
def test_a_camera_that_looks_at_the_wall_ends_the_run(
    steady: DrawnRun, turned_deg: float, wrong: bool
) -> None:
    got = estimated(steady)
    angle = np.radians(turned_deg)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    T_pc = got.T_pc.copy()
    T_pc[20:, :3, :3] = T_pc[20:, :3, :3] @ turn
    if not wrong:
        require_along_pipe(replace(got, T_pc=T_pc))
        return
    with pytest.raises(UnusableError, match=r"turned by 80°[^$]*Frames: 20, 21"):
        require_along_pipe(replace(got, T_pc=T_pc))


def test_where_texture_is_lost_the_camera_keeps_looking_along_the_pipe(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    k = np.arange(100)
    run, plain = (drawn_run(STEP * k, 0.004 * k, contrast=c) for c in (0.35, 0.0))
    sources = run.recording.source, plain.recording.source
    assert isinstance(sources[0], MemorySource)
    assert isinstance(sources[1], MemorySource)
    images = {n: sources[int(n > 30)].images[n] for n in sources[0].images}
    source = MemorySource(images, run.probe.camera.image_size)
    faded = replace(run, recording=replace(run.recording, source=source))

    def lean_deg() -> float:
        along = np.einsum("ni,ni->n", estimated(faded).T_pc[:, :3, 2], run.T_pc[:, :3, 2])
        return float(np.degrees(np.arccos(along.min())))

    assert lean_deg() < 1.5
    monkeypatch.setattr(residuals, "_VIEW_RAD", 1e3)
    assert lean_deg() > 2, "control: it keeps turning"


def test_matches_that_do_not_agree_are_replaced() -> None:
    """Matches whose error grows a little in each frame must not end the tracking."""
    grid = StripGrid(RADIUS, 400, 12.0, 60.0)
    tracker = TextureTracker(small_probe(), grid, PARAMETERS, Hidden())
    strip = np.random.default_rng(0).standard_normal((80, 400)).astype(np.float32)
    patches = cut(strip, np.full(40, 40), np.arange(40) * 10, 8)
    tracker._map.add(np.stack([np.full(40, 40.0), np.arange(40) * 10.0], -1), 0, patches)
    away = 4 * np.random.default_rng(1).standard_normal((40, 2))
    at = np.stack([np.full(40, 40.0), np.arange(40) * 10.0], -1)
    found = Matched(np.arange(40), np.ones(40, bool), at, away, np.full(40, 0.1))
    seen = Strip(
        0, strip, np.ones_like(strip, bool), np.zeros((21, 101, 2), np.float32), np.ones(80, np.float32)
    )
    tracker._record(found, seen, 1)
    assert found.lost
    assert tracker._map.retired.all()
    assert not replace(found, offset=0 * away).lost, "control: these agree"
