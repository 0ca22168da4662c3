"""How fast the wall passes the camera, by poses of frames that are far apart in time."""

import numpy as np
import pytest
from scipy.interpolate import make_smoothing_spline

from pipeline.geometry.rigid import rotation_from_vector
from stages.diagnose.gauge import points
from stages.diagnose.gauge.points import Moving, rates


def swaying(time_s: np.ndarray) -> np.ndarray:
    """Return poses (N, 4, 4) that go on, sway across and roll."""
    T = np.tile(np.eye(4), (len(time_s), 1, 1))
    T[:, :3, 3] = np.stack(
        [1.5 * np.sin(3.5 * time_s), np.cos(2.0 * time_s), 20 * time_s + 2 * np.sin(time_s)], 1
    )
    turn = np.stack([0.02 * np.sin(2 * time_s), 0.03 * np.cos(1.5 * time_s), 0.6 * np.sin(1.2 * time_s)], 1)
    T[:, :3, :3] = rotation_from_vector(turn)
    return T


def passing_exactly(time_s: np.ndarray, xyz_c: np.ndarray) -> np.ndarray:
    """Return d/dt of wall points' places in C by a step in time so short that its error is nothing."""
    step = 1e-4
    T, before, after = (swaying(time_s + s) for s in (0.0, -step, step))
    xyz_p = np.einsum("nij,nj->ni", T[:, :3, :3], xyz_c) + T[:, :3, 3]
    seen = [
        np.einsum("nji,nj->ni", at[:, :3, :3], xyz_p - at[:, :3, 3]) for at in (before, after)
    ]  # fmt: skip
    return (seen[1] - seen[0]) / (2 * step)


@pytest.mark.parametrize("rate_hz", [10.0, 30.0])
@pytest.mark.parametrize("lost", [(), (20, 21, 40)])
def test_the_wall_passes_as_fast_as_the_poses_move(rate_hz: float, lost: tuple[int, ...]) -> None:
    time_s = np.delete(np.arange(80) / rate_hz, lost)
    xyz_c = np.random.default_rng(1).normal(0, 30, (len(time_s), 3))
    found = Moving.of(swaying(time_s), time_s).passing_mm_s(np.arange(len(time_s)), xyz_c)
    wrong = (found - passing_exactly(time_s, xyz_c))[4:-4]
    assert np.sqrt(np.mean(wrong**2, axis=0)) == pytest.approx(np.zeros(3), abs=0.02)


def test_noise_of_poses_is_not_taken_for_motion() -> None:
    time_s = np.arange(240) / 30
    still = np.random.default_rng(2).normal(0, 0.01, (240, 3))
    assert np.sqrt(np.mean(rates(still, time_s) ** 2)) < 0.15


@pytest.mark.parametrize("count", [1, 2, 4])
def test_of_few_frames_the_rate_is_that_of_differences(count: int) -> None:
    time_s = np.arange(count) / 10
    assert rates(3 * time_s[:, None], time_s)[:, 0] == pytest.approx(np.full(count, 3.0 if count > 1 else 0))


def test_the_spline_is_set_up_once_for_all_that_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []

    def counted(x: np.ndarray, y: np.ndarray, lam: float) -> object:
        made.append(y.shape[1])
        return make_smoothing_spline(x, y, lam=lam)

    monkeypatch.setattr(points, "make_smoothing_spline", counted)
    time_s = np.arange(40) / 10
    T = swaying(time_s)
    moving = Moving.of(T, time_s)
    assert made == [6]
    assert moving.speed_mm_s == pytest.approx(rates(T[:, 2:3, 3], time_s)[:, 0], rel=1e-12)
