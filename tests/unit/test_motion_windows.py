"""A run cut into windows and joined again equals one adjustment of all frames, within a fraction of σ."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.geometry.axis import PipeAxis, straight_axis
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform, vector_from_rotation
from pipeline.machine.scratch import Scratch
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.landmarks import ObservationStore, Tracks
from stages.motion.tracking.tracker import TrackedTexture
from stages.motion.windows.error_chain import ErrorChain, Link
from stages.motion.windows.shared_error import with_shared_error
from stages.motion.windows.sliding_window import RunEstimate, adjust_run
from stages.motion.windows.submap_joining import JoinedRun, join_submaps
from stages.motion.windows.submaps import (
    SharedInformation,
    SharedParameters,
    Submap,
    Window,
    carried_error,
    cut_windows,
    fuse_shared,
    handover,
)
from tests.drawn_run import small_probe
from tests.long_motion import LongMotion, long_motion

FRAMES, SHARED = 240, 3


@pytest.fixture(scope="module")
def drawn() -> LongMotion:
    return long_motion(FRAMES, 0.6, 2.0)


@pytest.fixture(scope="module")
def at_once(drawn: LongMotion) -> RunEstimate:
    return estimated(drawn, FRAMES, 20)


@pytest.fixture(scope="module")
def in_windows(drawn: LongMotion) -> RunEstimate:
    return estimated(drawn, 110, 50)


def estimated(drawn: LongMotion, window: int, overlap: int) -> RunEstimate:
    parameters = MotionParameters.model_validate({"window_frames": window, "overlap_frames": overlap})
    return adjust_run(drawn.run, parameters, lambda estimate: None, lambda done, total: None)


def since_first(T_pc: Float) -> Float:
    return inverse(T_pc[0]) @ T_pc


def difference(T_pc: Float, other_T_pc: Float) -> Float:
    """Return (N, 6) differences of translations and rotation vectors, relative to the first poses."""
    a, b = since_first(T_pc), since_first(other_T_pc)
    turn = vector_from_rotation(np.swapaxes(b[:, :3, :3], 1, 2) @ a[:, :3, :3])
    return np.concatenate([a[:, :3, 3] - b[:, :3, 3], turn], -1)


def sigma_of(run: JoinedRun) -> Float:
    return np.sqrt(np.diagonal(run.covariance, axis1=1, axis2=2))


def test_windows_agree_with_one_adjustment_of_all_frames(
    at_once: RunEstimate, in_windows: RunEstimate
) -> None:
    one, many = at_once.joined, in_windows.joined
    apart = difference(many.T_pc, one.T_pc)[10:] / sigma_of(one)[10:]
    assert np.abs(apart).max() < 0.35
    assert in_windows.trials > at_once.trials, "control: it was cut"
    sigma = np.sqrt(np.diagonal(one.shared.covariance))
    assert np.abs((many.shared.value - one.shared.value) / sigma).max() < 0.5
    assert many.radius_mm == pytest.approx(one.radius_mm, abs=0.005)


def test_stated_sigma_agrees_with_one_adjustment_of_all_frames(
    at_once: RunEstimate, in_windows: RunEstimate
) -> None:
    one, many = sigma_of(at_once.joined)[10:], sigma_of(in_windows.joined)[10:]
    assert np.all(many / one > 0.7)
    assert np.all(many / one < 1.5)


def test_sigma_of_the_distance_is_that_of_a_straight_pipe_and_of_all_frames_at_once(
    at_once: RunEstimate, in_windows: RunEstimate
) -> None:
    # In a straight pipe of a few windows heading does not change the length: the last pose's z has the same
    # σ.
    for estimate in (at_once, in_windows):
        last = np.sqrt(estimate.joined.covariance[-1, 2, 2])
        assert estimate.joined.distance_sigma_mm == pytest.approx(last, rel=0.05)
    alone, cut = (e.joined.distance_sigma_mm for e in (at_once, in_windows))
    assert cut == pytest.approx(alone, rel=0.1)


def test_errors_are_within_sigma(drawn: LongMotion, in_windows: RunEstimate) -> None:
    run = in_windows.joined
    error = difference(run.T_pc, drawn.T_pc)[10:]
    assert np.mean(np.abs(error / sigma_of(run)[10:]) < 3) > 0.97


def test_many_windows_with_a_common_error_do_not_overrule_the_stated_uncertainty(drawn: LongMotion) -> None:
    parameters, window = MotionParameters.model_validate({}), Window(0, 110)
    measured = drawn.run.measured(window, parameters)
    state = drawn.run.start(window, measured, parameters)
    numbers = 1 + len(state.instrument)
    say = SharedInformation(np.append(1.0, np.full(numbers - 1, 0.5)), np.eye(numbers))

    def settled(windows: int) -> SharedParameters:
        return fuse_shared([say] * windows, [1.0] * windows, measured, state)

    one, two, three, many = (settled(windows) for windows in (1, 2, 3, 80))
    np.testing.assert_allclose(one.value, say.value)
    assert np.all(two.value[1:] > one.value[1:])
    assert np.all(three.value[1:] > two.value[1:])
    np.testing.assert_allclose(many.value, three.value)
    np.testing.assert_allclose(many.covariance, three.covariance)


def test_windows_cover_all_frames_and_overlap() -> None:
    for frames, length, overlap in ((100, 200, 20), (200, 200, 20), (201, 200, 20), (5000, 700, 150)):
        windows = cut_windows(frames, length, overlap)
        assert (windows[0].first, windows[-1].last) == (0, frames)
        assert all(a.last - b.first >= overlap for a, b in pairwise(windows))
        assert all(a.first < handover(a, b) < a.last for a, b in pairwise(windows))
        assert len(windows) == 1 or {w.frames for w in windows} == {length}


def submaps(T_pc: Float, axis: PipeAxis, windows: tuple[Window, ...]) -> list[Submap]:
    """Return pieces of one course, each displaced as a whole, without any other error."""
    random = np.random.default_rng(3)
    found = []
    for k, window in enumerate(windows):
        moved = from_parts(rotation_from_vector(0.2 * random.standard_normal(3)), random.standard_normal(3))
        moved = np.eye(4) if k == 0 else moved
        origin, R = transform(moved, axis.origin_p), moved[:3, :3] @ axis.R_pa
        own = PipeAxis(axis.distance_mm + (k > 0) * random.standard_normal(), origin, R)
        anchor = 0 if k == 0 else handover(windows[k - 1], window) - window.first
        end = window.frames - 1 if k + 1 == len(windows) else handover(window, windows[k + 1]) - window.first
        some = np.unique(np.linspace(anchor, end, 4).astype(int))
        together = 1e-4 * np.minimum.outer(some - anchor, some - anchor)
        joint = together[:, None, :, None] * np.eye(6)[None, :, None, :]
        found.append(
            Submap(
                window,
                moved @ T_pc[window.first : window.last],
                np.full(window.frames, float(k)),
                own,
                50.0,
                anchor,
                some,
                joint,
                np.zeros((len(some), 6, SHARED)),
                0.01,
                np.zeros(SHARED),
            )
        )
    return found


def test_pieces_of_one_course_are_joined_to_that_course() -> None:
    k = np.arange(100)
    turn = np.stack([0.01 * np.sin(k / 9), 0.02 * np.cos(k / 7), 0.01 * k], -1)
    T_pc = from_parts(rotation_from_vector(turn), np.stack([np.sin(k / 20), np.cos(k / 15), 0.7 * k], -1))
    windows = cut_windows(100, 40, 20)
    axis = straight_axis(-30.0, 150.0)
    settled = SharedParameters(np.zeros(SHARED), np.eye(SHARED))
    got = join_submaps(submaps(T_pc, axis, windows), settled)
    np.testing.assert_allclose(got.T_pc, T_pc, atol=1e-9)
    np.testing.assert_allclose(got.slip, 0, atol=1e-12)
    np.testing.assert_allclose(got.axis.origin_p[:, :2], 0, atol=1e-9)
    broken = submaps(T_pc, axis, windows)
    broken[1] = replace(
        broken[1], T_pc=from_parts(broken[1].T_pc[:, :3, :3], 1.001 * broken[1].T_pc[:, :3, 3])
    )
    assert np.abs(join_submaps(broken, settled).T_pc - T_pc).max() > 1e-4, "control: the pieces are apart"
    variance = got.covariance[:, 0, 0]
    assert np.all(np.diff(variance) > -1e-9), "errors only grow"


def test_an_error_of_the_anchor_moves_the_rest_as_a_whole() -> None:
    random = np.random.default_rng(1)
    T_pc = from_parts(
        rotation_from_vector(random.standard_normal((5, 3))), 30 * random.standard_normal((5, 3))
    )
    step = 1e-6 * random.standard_normal(6)

    def moved(T: Float, by: Float) -> Float:
        return from_parts(T[:3, :3] @ rotation_from_vector(by[3:]), T[:3, 3] + by[:3])

    whole = moved(T_pc[0], step) @ inverse(T_pc[0])
    for T, carry in zip(T_pc, carried_error(T_pc, T_pc[0]), strict=True):
        np.testing.assert_allclose(moved(T, carry @ step), whole @ T, atol=1e-9)


def test_tracks_are_read_from_the_disk_thinned_and_cut() -> None:
    store = ObservationStore.on(Scratch(), most=4)
    for frame in range(20):
        seen = np.array([0, 1] if frame < 12 else [1, 2])
        store.add(
            seen, frame, np.stack([seen + frame, seen], -1).astype(float), 0.1 + 0 * seen, np.zeros((2, 2))
        )
        if frame == 12:
            store.write(np.array([0]))
    store.write()
    found = store.between(0, 20)
    assert np.array_equal(np.bincount(found["landmark"]), [4, 4, 4])
    assert np.all(np.diff(found["frame"][found["landmark"] == 1]) == 5), "spread evenly"
    np.testing.assert_array_equal(found["uv"][:, 0], found["landmark"] + found["frame"])
    assert not len(store.between(0, 3)), "seen less than three times in them"
    part = store.between(0, 12)
    assert set(part["landmark"]) == {0}
    assert part["frame"].max() < 12


def test_matches_with_larger_disagreement_share_more_of_their_error() -> None:
    usual = MotionParameters()
    assert with_shared_error(usual, 0.14) is usual
    assert with_shared_error(usual, 0.6).match_bias_px == pytest.approx(0.2)
    MotionParameters.model_validate(with_shared_error(usual, 50.0).model_dump())


class Noisy(TrackedTexture):
    """Texture whose matches have noise alone."""

    def between(self, first: int, last: int) -> Tracks:
        tracks = super().between(first, last)
        noise = 0.4 * np.random.default_rng(1).standard_normal(tracks.uv.shape)
        return replace(tracks, uv=tracks.uv + noise)


class Lagging(Noisy):
    """Texture behind a fast codec: off by the same for some frames, and with too little motion far ahead."""

    def between(self, first: int, last: int) -> Tracks:
        tracks, camera = super().between(first, last), small_probe().camera
        away = tracks.uv - camera.centre_px
        lag_px = np.clip((np.radians(45) - tracks.polar_angle(camera)) / np.radians(7), 0, 1)
        lag = lag_px[:, None] * away / np.linalg.norm(away, axis=1, keepdims=True)
        spans = tracks.landmark, tracks.frame // 10
        shape = [1 + int(span.max()) for span in spans]
        lasting = 0.4 * np.random.default_rng(2).standard_normal((*shape, 2))[spans]
        return replace(tracks, uv=tracks.uv - lag + lasting)


def with_texture(drawn: LongMotion, shown: type[TrackedTexture]) -> RunEstimate:
    """Return the motion of a run without encoder."""
    texture = drawn.run.texture
    run = replace(drawn.run, encoder=None, texture=shown(texture.store, texture.grid, texture.poses))
    return estimated(replace(drawn, run=run), 100, 20)


def test_texture_that_lags_far_ahead_does_not_lengthen_the_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, off = long_motion(100, 0.6, 4.0), []
    for farthest in (np.radians(45), 0.0):
        monkeypatch.setattr("stages.motion.windows.first_window._FARTHEST_RAD", farthest)
        found = with_texture(drawn, Lagging).joined.T_pc
        off.append(difference(found, drawn.T_pc)[-1, 2] / np.ptp(drawn.T_pc[:, 2, 3]))
    assert abs(off[0]) < 0.3 * abs(off[1]), off


def test_noise_alone_does_not_exclude_texture() -> None:
    drawn = long_motion(100, 0.6, 4.0)
    farthest = [with_texture(drawn, shown).steady.run.farthest_rad for shown in (Noisy, Lagging)]
    assert farthest == [0.0, np.radians(45)]


def test_uncertain_heading_does_not_become_roll_where_the_pipe_turns() -> None:
    """The heading errs by a radian at the second anchor, behind which the pipe turns by a right angle."""
    right_angle = np.eye(6)
    right_angle[3:, 3:] = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    joint = np.zeros((2, 6, 2, 6))
    joint[1, 3:, 1, 3:] = np.diag([1.0, 0.0, 1e-6])
    carry = np.stack([np.eye(6), right_angle])
    links = tuple(Link(np.arange(2) + 2 * n, carry, joint, np.zeros((2, 6, 1))) for n in range(2))
    chain = ErrorChain(links, np.zeros((6, 6)), np.zeros((1, 1)))
    assert chain.covariances()[-1, 5, 5] > 0.9, "control: the roll of the poses contains the heading error"
    np.testing.assert_allclose(chain.turn_variances()[-1], [2.0, 0.0, 2e-6])
