"""Measures the laser line on a board of known pose, in the board's plane.

On a plane board the laser plane draws a straight line, whatever the camera. So the picture is resampled on a
grid in the board's plane, and the line is found there by consensus of the brightest points. Then it is
measured by fitting a Gaussian on a constant background to profiles across it, taken from the picture itself.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from pydantic import Field

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32
from pipeline.geometry.rigid import transform
from pipeline.instrument.camera import Camera
from pipeline.machine.stage import Parameters

# Points that take part in the consensus, and pairs of them that are drawn: bounds on time.
_MOST_CANDIDATES, _DRAWS = 4000, 400
# Half width of the consensus, distance of profiles along the line, and of samples across it. Half and twice
# of each move the plane of four rendered boards by 0.07 of its σ at most.
_LINE_PX, _STATION_PX, _PROFILE_STEP_PX = 2.0, 1.0, 0.5
_OUTLIER_SIGMAS = 3.0
_LARGEST_GRID = 4000
_OUTSIDE = -1e3
_STEPS = 12
# Start, and steps of place and log width, of the fit of a peak: half and twice change nothing.
_LARGEST_STEP, _START_WIDTH, _LEAST_WIDTH = np.array([2.0, 0.3]), 3.0, 0.8
_WIDEST_SHARE = 0.4


class LaserPlaneParameters(Parameters):
    """Parameters of the search of the laser line, of its detection, and of refusing pictures."""

    wavelength_nm: float = Field(default=520.0, ge=380, le=750, description="wavelength of the laser, nm")
    margin_squares: float = Field(
        default=1.0,
        ge=0,
        le=50,
        description="margin of flat board beyond the outermost corners found, squares",
    )
    huber_px: float = Field(
        default=1.0, gt=0, le=20, description="residual beyond which a corner's cost is linear (Huber), px"
    )
    largest_pose_rms_px: float = Field(
        default=1.0, gt=0, le=20, description="boards whose corners fit the camera worse are not used, px"
    )
    window_px: float = Field(
        default=6.0, ge=3, le=50, description="half width of the profile across the line, px"
    )
    least_contrast: float = Field(
        default=6.0, ge=2, le=100, description="height of the line above the noise, in 1 σ of the noise"
    )
    least_points: int = Field(
        default=40, ge=10, le=100000, description="a line seen at fewer places is not used"
    )
    least_pictures: int = Field(
        default=3, ge=2, le=1000, description="fewer pictures with a line are refused"
    )
    least_spread: float = Field(
        default=0.05,
        gt=0,
        le=1,
        description="least spread of the lines across their common direction, over their spread along it",
    )
    largest_tilt_sigma_deg: float = Field(
        default=0.5, gt=0, le=10, description="a larger 1 σ of the plane's direction is refused, deg"
    )


def fit_peaks(profiles: Float, least_contrast: float) -> Float:
    """Return the places (S,) of the peaks of profiles (S, 2 H + 1), in samples from the middle.

    Least squares of A exp(−(x − c)² / 2w²) + b by Gauss-Newton with A and b solved for at every step
    (variable projection in Kaufman's form). NaN where a profile is not seen whole, its peak is not inside
    the window, or it rises less than ``least_contrast`` times the residuals' 1 σ.
    """
    whole = np.isfinite(profiles).all(1)
    peak = np.full(len(profiles), np.nan)
    if whole.any():
        peak[whole] = _fit(profiles[whole], least_contrast)
    return peak


def _fit(y: Float, least_contrast: float) -> Float:
    half = y.shape[1] // 2
    x = np.arange(-half, half + 1, dtype=float)
    centre, log_width = x[np.argmax(y, 1)], np.full(len(y), np.log(_START_WIDTH))
    for _ in range(_STEPS):
        bell, height, residual = _linear_part(x, y, centre, log_width)
        z = (x - centre[:, None]) * np.exp(-log_width)[:, None]
        by_centre = height[:, None] * bell * z * np.exp(-log_width)[:, None]
        jacobian = _without(np.stack([by_centre, height[:, None] * bell * z * z], -1), bell)
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian + 1e-9 * np.eye(2)
        step = np.linalg.solve(normal, np.swapaxes(jacobian, 1, 2) @ residual[..., None])[..., 0]
        step = np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
        centre = np.clip(centre + step[:, 0], -half, half)
        log_width = np.clip(log_width + step[:, 1], np.log(_LEAST_WIDTH), np.log(_WIDEST_SHARE * half))
    _, height, residual = _linear_part(x, y, centre, log_width)
    noise = np.sqrt(np.sum(residual**2, 1) / (len(x) - 4))
    good = (height > least_contrast * noise) & (np.abs(centre) < half - np.exp(log_width))
    return np.where(good, centre, np.nan)


def _linear_part(x: Float, y: Float, centre: Float, log_width: Float) -> tuple[Float, Float, Float]:
    """Return the bells (S, X), the best heights (S,) and the residuals (S, X) with the best background."""
    bell = np.exp(-0.5 * ((x - centre[:, None]) * np.exp(-log_width)[:, None]) ** 2)
    varying = bell - bell.mean(1, keepdims=True)
    risen = y - y.mean(1, keepdims=True)
    height = np.sum(varying * risen, 1) / np.maximum(np.sum(varying**2, 1), 1e-12)
    return bell, height, risen - height[:, None] * varying


def _without(jacobian: Float, bell: Float) -> Float:
    """Return the columns (S, X, 2) without their components along a constant and the bell."""
    varying = bell - bell.mean(1, keepdims=True)
    unit = varying / np.maximum(np.linalg.norm(varying, axis=1, keepdims=True), 1e-12)
    centred = jacobian - jacobian.mean(1, keepdims=True)
    return np.asarray(centred - unit[..., None] * np.sum(unit[..., None] * centred, 1, keepdims=True))


class BoardPatch(NamedTuple):
    """The examined part of a board's plane.

    ``T_cb`` (4, 4), corners ``low_mm`` and ``high_mm`` (2,) in B, ``mm_per_px`` of the picture there.
    """

    T_cb: Float
    low_mm: Float
    high_mm: Float
    mm_per_px: float


class StraightLine(NamedTuple):
    """Points ``origin`` + t · ``direction`` in the board's plane, mm, t from ``start`` to ``stop``."""

    origin: Float
    direction: Float
    start: float
    stop: float

    @property
    def across(self) -> Float:
        """(2,) unit vector perpendicular to the line."""
        return np.array([-self.direction[1], self.direction[0]])


def patch_around(xyz_b: Float, uv: Float, T_cb: Float, margin_mm: float) -> BoardPatch:
    """Return the patch that holds the corners (N, 3), seen at ``uv`` (N, 2), and a margin around them."""
    low, high = xyz_b[:, :2].min(0), xyz_b[:, :2].max(0)
    hull = cv2.convexHull(uv.astype(np.float32))
    mm_per_px = float(np.sqrt(np.prod(high - low) / max(cv2.contourArea(hull), 1.0)))
    return BoardPatch(T_cb, low - margin_mm, high + margin_mm, mm_per_px)


def measure_line(
    excess: Float32, camera: Camera, patch: BoardPatch, parameters: LaserPlaneParameters
) -> Float:
    """Return the laser line's points (N, 2), mm in the board's plane; N is 0 where no line is seen.

    Parameters
    ----------
    excess : (H, W)
        Excess of the laser's colour over grey in each pixel, grey levels.
    """
    candidates, height = _candidates(excess, camera, patch, parameters)
    line = _consensus(candidates, height, _LINE_PX * patch.mm_per_px)
    if line is None:
        return np.zeros((0, 2))
    stations = _stations(line, patch)
    step_mm = _PROFILE_STEP_PX * patch.mm_per_px
    offset_mm = step_mm * _window(parameters)
    profiles = _sample(excess, camera, patch, stations[:, None] + offset_mm[:, None] * line.across)
    peak = fit_peaks(profiles, parameters.least_contrast)
    points = stations + step_mm * peak[:, None] * line.across
    return _straight(points[np.isfinite(peak)])


def _candidates(
    excess: Float32, camera: Camera, patch: BoardPatch, parameters: LaserPlaneParameters
) -> tuple[Float, Float]:
    """Return the board points (K, 2) with the largest contrast to their surroundings, and heights (K,)."""
    step = max(patch.mm_per_px, float(np.max(patch.high_mm - patch.low_mm)) / _LARGEST_GRID)
    columns, rows = (np.arange(a, b, step) for a, b in zip(patch.low_mm, patch.high_mm, strict=True))
    grid = np.stack(np.meshgrid(columns, rows), -1)
    face = _sample(excess, camera, patch, grid)
    seen = np.isfinite(face)
    if not seen.any():
        return np.zeros((0, 2)), np.zeros(0)
    raised = _raised(np.where(seen, face, np.median(face[seen])), parameters.window_px)
    noise = robust_spread(raised[seen])
    stands_out = seen & (raised > max(parameters.least_contrast * noise, 1.0)) & _ridge(raised)
    height = raised[stands_out]
    best = np.argsort(-height, kind="stable")[:_MOST_CANDIDATES]
    return grid[stands_out][best], height[best].astype(float)


def _raised(face: Float, window_px: float) -> Float:
    """Return a picture smoothed by a pixel, minus its wider-scale background."""
    single = face.astype(np.float32)
    fine, coarse = (cv2.GaussianBlur(single, (0, 0), s) for s in (1.0, window_px))
    return np.asarray(fine - coarse, np.float64)


def _ridge(raised: Float) -> Bool:
    """Return where a picture has a maximum along its row or its column."""
    highest = np.zeros(raised.shape, bool)
    for kernel in (np.ones((1, 3), np.uint8), np.ones((3, 1), np.uint8)):
        highest |= raised >= cv2.dilate(raised, kernel)
    return highest


def _consensus(points: Float, height: Float, tolerance_mm: float) -> StraightLine | None:
    """Return the straight line with the largest summed height of points (K, 2) (RANSAC, fixed draws)."""
    if len(points) < 2:
        return None
    random = np.random.default_rng(0)
    pair = random.choice(len(points), (_DRAWS, 2), p=height / height.sum())
    direction = points[pair[:, 1]] - points[pair[:, 0]]
    length = np.linalg.norm(direction, axis=1)
    pair, direction = pair[length > 0], direction[length > 0] / length[length > 0, None]
    if not len(pair):
        return None
    across = np.stack([-direction[:, 1], direction[:, 0]], 1)
    distance = np.abs(across @ points.T - np.sum(across * points[pair[:, 0]], 1)[:, None])
    best = int(np.argmax((distance < tolerance_mm) @ height))
    inlier = distance[best] < tolerance_mm
    return _line_through(points[inlier], height[inlier])


def _line_through(points: Float, weight: Float) -> StraightLine:
    origin = weight @ points / weight.sum()
    centred = points - origin
    direction = np.linalg.eigh((centred * weight[:, None]).T @ centred)[1][:, 1]
    along = centred @ direction
    return StraightLine(origin, direction, float(along.min()), float(along.max()))


def _stations(line: StraightLine, patch: BoardPatch) -> Float:
    """Return points (S, 2) along the line, a pixel apart, within its seen part."""
    along = np.arange(line.start, line.stop, _STATION_PX * patch.mm_per_px)
    return np.asarray(line.origin + along[:, None] * line.direction)


def _window(parameters: LaserPlaneParameters) -> Float:
    half = int(np.ceil(parameters.window_px / _PROFILE_STEP_PX))
    return np.arange(-half, half + 1, dtype=float)


def _sample(excess: Float32, camera: Camera, patch: BoardPatch, xy_b: Float) -> Float:
    """Return the picture's values at board points (..., 2), NaN outside of the picture."""
    xyz_b = np.concatenate([xy_b, np.zeros_like(xy_b[..., :1])], -1)
    uv, valid = camera.project(transform(patch.T_cb, xyz_b.reshape(-1, 3)))
    height, width = excess.shape
    inside = valid & np.all((np.nan_to_num(uv, nan=-1) >= 0) & (uv <= [width - 1, height - 1]), -1)
    where = np.where(inside[:, None], uv, _OUTSIDE).reshape(*xy_b.shape[:2], 2).astype(np.float32)
    value = cv2.remap(excess, where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    return np.where(inside.reshape(xy_b.shape[:2]), value, np.nan)


def _straight(points: Float) -> Float:
    """Return the points (N, 2) without those that are off their own straight line."""
    for _ in range(5):
        if len(points) < 3:
            return points
        line = _line_through(points, np.ones(len(points)))
        distance = np.abs((points - line.origin) @ line.across)
        limit = _OUTLIER_SIGMAS * robust_spread(distance)
        points = points[distance <= max(limit, 1e-9)]
    return points
