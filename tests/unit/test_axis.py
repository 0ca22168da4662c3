"""Conversion to pipe coordinates and back, on a straight and on a bent axis."""

import numpy as np
import pytest

from pipeline.arrays import read_only
from pipeline.geometry import axis_kernels as module
from pipeline.geometry.axis import PipeAxis, distance_along, frames_at, from_pipe, to_pipe


def arc_axis(curvature_per_mm: float) -> PipeAxis:
    """Return an axis bending toward +x in the x-z plane, with a point each 5 mm from -50 to 300 mm."""
    s = np.arange(-50.0, 301.0, 5.0)
    turn = s * curvature_per_mm
    if curvature_per_mm:
        x, z = (1 - np.cos(turn)) / curvature_per_mm, np.sin(turn) / curvature_per_mm
    else:
        x, z = 0 * s, s
    tangent = np.stack([np.sin(turn), 0 * s, np.cos(turn)], -1)
    side = np.stack([np.cos(turn), 0 * s, -np.sin(turn)], -1)
    up = np.stack([0 * s, 1 + 0 * s, 0 * s], -1)
    return PipeAxis(s, np.stack([x, 0 * s, z], -1), np.stack([side, up, tangent], -1))


@pytest.mark.parametrize("curvature", [0.0, 4e-4, 2e-3])
def test_points_return_to_their_coordinates(curvature: float) -> None:
    axis = arc_axis(curvature)
    s, psi = np.meshgrid(np.linspace(-10, 250, 27), np.linspace(-3.1, 3.1, 31), indexing="ij")
    r = 50 + np.sin(3 * psi)
    got_s, got_psi, got_r = to_pipe(axis, from_pipe(axis, s, psi, r))
    np.testing.assert_allclose(got_s, s, atol=1e-4)
    np.testing.assert_allclose(got_psi, psi, atol=1e-6)
    np.testing.assert_allclose(got_r, r, atol=1e-4)


def test_straight_axis_is_cylindrical_coordinates() -> None:
    p = from_pipe(arc_axis(0.0), np.array(12.0), np.array(np.pi / 2), np.array(25.0))
    np.testing.assert_allclose(p, [0, 25, 12], atol=1e-12)


def test_frames_are_rotations_and_straight_beyond_the_ends() -> None:
    origin, frame = frames_at(arc_axis(2e-3), np.array([-200.0, -51.0, 7.3, 400.0]))
    np.testing.assert_allclose(
        frame @ np.swapaxes(frame, -1, -2), np.broadcast_to(np.eye(3), (4, 3, 3)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(frame), 1)
    assert np.linalg.norm(origin[0] - origin[1]) == pytest.approx(149.0, abs=0.01)


def test_distances_of_poses_are_right_in_a_bend() -> None:
    axis = arc_axis(0.0105)  # half a turn and more: z in P comes back down
    s = np.array([0.0, 100.0, 200.0, 290.0])
    T_pc = np.tile(np.eye(4), (len(s), 1, 1))
    T_pc[:, :3, 3] = from_pipe(axis, s, np.full(4, 0.7), np.full(4, 3.0))
    np.testing.assert_allclose(distance_along(axis, T_pc), s, atol=1e-3)
    assert T_pc[-1, 2, 3] < T_pc[1, 2, 3]


def test_arrays_of_any_layout_use_the_code_compiled_for_the_first() -> None:
    axis = arc_axis(2e-3)
    stored = PipeAxis(*(read_only(a) for a in (axis.distance_mm, axis.origin_p, axis.R_pa)))
    points = np.random.default_rng(3).normal(size=(7, 6)) + np.array([30.0, 0, 20] * 2)
    first = to_pipe(axis, points[:, :3].copy())
    frames_at(axis, first[0])
    before = compiled()
    for same in (axis, stored):
        for xyz_p in (points[:, :3], read_only(points[:, :3]), np.asfortranarray(points[:, :3])):
            np.testing.assert_array_equal(to_pipe(same, xyz_p), first)
            frames_at(same, read_only(first[0]))
    assert len(before) >= 3, "control: there are compiled functions to look at"
    assert compiled() == before


def compiled() -> dict[str, int]:
    """Return how often each compiled function of the module was compiled."""
    return {name: len(k.signatures) for name, k in vars(module).items() if hasattr(k, "signatures")}
