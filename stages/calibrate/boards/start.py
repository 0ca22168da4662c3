"""Starting values: an equidistant camera whose focal length explains the views, and the boards' poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.rigid import from_parts, perspective_pose
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardView
from pipeline.instrument.camera.fisheye import Equidistant, KannalaBrandt
from pipeline.instrument.camera.plumb_bob import Pinhole, Unified
from pipeline.instrument.camera.scaramuzza import Scaramuzza
from stages.calibrate.boards.bundle import FLAT, POSES_ONLY, STOP, Corners, Estimate, Free, cost, solve

# Half fields of view from which the fit is tried. Half and twice as many of them, and half and twice the
# other constants of this block, move no parameter of Kannala-Brandt cameras by 1e-6 of its σ (three sets of
# 14 drawn views).
_HALF_FIELDS_RAD = np.geomspace(0.15, 2.6, 14)
_SAMPLE_CORNERS = 24
_START_HUBER_PX = 5.0
# Least forward part of a unit ray, and corners with such a ray, that SQPnP is given; sensitivity as above.
_NEAR_FORWARD, _LEAST_POINTS = 0.3, 4
# Polar angle up to which the first polynomial is fitted: with 1.4 and 3.1 rad no Scaramuzza camera moves by
# 1e-6 of its σ.
_WIDEST_FIT_RAD = 2.8
# Steps with each half field before they are compared; only the best is fitted to its end. In ten drawn sets
# for six cameras the best after 3 steps was the best in the end, and after 8 its cost was within .1 % of
# that.
_COMPARED = replace(STOP, trials=8)
_FOCAL, _ALL = Free(np.arange(2), FLAT), Free(np.arange(4), FLAT)


def start(views: Sequence[BoardView], image_size: tuple[int, int]) -> Estimate:
    """Return the best equidistant camera, centred in the image at first, with all poses.

    Half fields of view from 9° to 149° are tried on a few corners of every view; the best is refined.
    """
    sample = [_thinned(view) for view in views]
    corners = Corners.of(sample)
    tried = [_posed(sample, corners, _equidistant(image_size, half)) for half in _HALF_FIELDS_RAD]
    best = min(tried, key=lambda e: cost(e.residuals(corners), _START_HUBER_PX))
    best = solve(best, corners, _FOCAL, _START_HUBER_PX)
    return solve(best, Corners.of(views), _ALL, _START_HUBER_PX)


def pose(view: BoardView, camera: Camera) -> Float:
    """Return a first ``T_cb`` (4, 4) of a view: SQPnP in a virtual camera that faces the board.

    Turning the rays so that their mean looks forward lets a method for pinhole images serve beyond 90°.
    """
    rays = camera.unproject(view.uv)
    ray, xyz_b = rays.ray[rays.valid], view.xyz_b[rays.valid]
    turn = _rotation_to_forward(ray.mean(0)) if len(ray) else np.eye(3)
    turned = ray @ turn.T
    ahead = turned[:, 2] > _NEAR_FORWARD
    if np.count_nonzero(ahead) < _LEAST_POINTS:
        return from_parts(np.eye(3), np.array([0.0, 0.0, float(np.ptp(view.xyz_b))]) - view.xyz_b.mean(0))
    xyz_b, plane = xyz_b[ahead], turned[ahead, :2] / turned[ahead, 2:]
    T_fb = perspective_pose(xyz_b, plane)
    if T_fb is None:  # facing the camera
        size, angle = np.ptp(xyz_b, axis=0).max(), max(float(np.ptp(plane)), 1e-6)
        T_fb = from_parts(np.eye(3), np.array([0.0, 0.0, size / angle]) - xyz_b.mean(0))
    return from_parts(turn.T @ T_fb[:3, :3], turn.T @ T_fb[:3, 3])


def model_start(model: str, estimate: Estimate, theta_max: float, degree: int) -> Camera:
    """Return a camera of ``model`` that projects nearly as the equidistant one up to ``theta_max``.

    ``degree`` is that of Scaramuzza's polynomial.
    """
    seed = estimate.camera
    size, (fx, fy, cx, cy) = seed.image_size, (float(p) for p in seed.parameters)
    match model:
        case "kannala_brandt":
            return KannalaBrandt(size, (fx, fy), (cx, cy))
        case "scaramuzza":
            return Scaramuzza(size, (cx, cy), _equidistant_polynomial((fx + fy) / 2, theta_max, degree))
        case "unified":
            return Unified(size, 1.0, (2 * fx, 2 * fy), (cx, cy))
        case "pinhole":
            return Pinhole(size, (fx, fy), (cx, cy))
        case "equidistant":
            return Equidistant(size, (fx, fy), (cx, cy))
        case _:
            raise ValueError(f"no camera model {model!r}")


def _equidistant(image_size: tuple[int, int], half_field_rad: float) -> Equidistant:
    width, height = image_size
    focal = np.hypot(width, height) / 2 / half_field_rad
    return Equidistant(image_size, (focal, focal), ((width - 1) / 2, (height - 1) / 2))


def _equidistant_polynomial(focal: float, theta_max: float, degree: int) -> tuple[float, ...]:
    """Fit z(ρ) = ρ / tan(ρ/f) by a0 + a2 ρ² + … + aN ρᴺ, in OCamCalib's sign."""
    theta = np.linspace(1e-3, min(theta_max, _WIDEST_FIT_RAD), 200)
    powers = np.array([0, *range(2, degree + 1)])
    fitted = np.linalg.lstsq(theta[:, None] ** powers, -focal * theta / np.tan(theta), rcond=None)[0]
    coefficients = np.zeros(degree + 1)
    coefficients[powers] = fitted / focal**powers
    return tuple(float(a) for a in coefficients)


def _posed(sample: list[BoardView], corners: Corners, camera: Camera) -> Estimate:
    T_cb = np.stack([pose(view, camera) for view in sample])
    return solve(Estimate(camera, T_cb, np.zeros(3)), corners, POSES_ONLY, _START_HUBER_PX, _COMPARED)


def _thinned(view: BoardView) -> BoardView:
    pick = np.unique(np.linspace(0, len(view.uv) - 1, _SAMPLE_CORNERS).astype(int))
    return BoardView(view.name, view.xyz_b[pick], view.uv[pick])


def _rotation_to_forward(direction: Float) -> Float:
    """Return a rotation that takes ``direction`` to +z."""
    z = direction / np.linalg.norm(direction)
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])
