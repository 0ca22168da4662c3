"""Boards seen by a known camera: their corners with noise, and rendered pictures."""

import cv2
import numpy as np

from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardView
from stages.calibrate.boards.detect import grid


def facing_pose(direction, distance_mm, tilt):
    """Return ``T_cb`` of a board centred along a direction, facing the camera, then tilted by a vector."""
    z = np.asarray(direction, float) / np.linalg.norm(direction)
    x = np.cross([0.0, 1.0, 0.1], z)
    x /= np.linalg.norm(x)
    facing = np.stack([x, np.cross(z, x), z], 1)
    return from_parts(facing @ rotation_from_vector(np.asarray(tilt, float)), distance_mm * z)


def varied_poses(random, count, widest_rad, distance_mm=(70.0, 140.0), tilt_rad=0.45):
    """Return board poses spread over directions up to a polar angle."""
    poses = []
    for _ in range(count):
        theta, psi = widest_rad * np.sqrt(random.uniform()), random.uniform(-np.pi, np.pi)
        direction = [np.sin(theta) * np.cos(psi), np.sin(theta) * np.sin(psi), np.cos(theta)]
        poses.append(facing_pose(direction, random.uniform(*distance_mm), random.normal(0, tilt_rad, 3)))
    return poses


def views_of(
    camera: Camera, poses, random, sigma_px=0.1, size=(9, 6), square_mm=20.0, sag_mm=(0.0, 0.0, 0.0)
):
    """Return the views in which at least 20 corners fall into the image."""
    xyz_b = grid(*size, square_mm)
    centred = xyz_b - xyz_b.mean(0)
    x, y = centred[:, :2].T / np.linalg.norm(centred, axis=1).max()
    bent = centred + (np.stack([x * x, x * y, y * y], -1) @ np.array(sag_mm))[:, None] * [0, 0, 1]
    views = []
    for i, T_cb in enumerate(poses):
        uv, valid = camera.project(bent @ T_cb[:3, :3].T + T_cb[:3, 3])
        inside = valid & np.all((np.nan_to_num(uv, nan=-1) > 0) & (uv < camera.image_size), -1)
        if inside.sum() >= 20:
            noisy = uv[inside] + random.normal(0, sigma_px, (inside.sum(), 2))
            views.append(BoardView(f"{i:02d}", xyz_b[inside], noisy))
    return views


def render(camera: Camera, T_cb, board_picture, px_per_mm, random, grey_sigma=2.0):
    """Return a noisy picture of a flat board without blur, from 3 × 3 rays in every pixel.

    ``board_picture`` is the face of the board; its pixel (c, r) lies at ((c + 0.5), (r + 0.5))

    px_per_mm minus half its size, in the board's plane.
    """
    width, height = camera.image_size
    offsets = (np.arange(3) - 1) / 3
    total = np.zeros((height, width))
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    for du in offsets:
        for dv in offsets:
            ray = camera.unproject(np.stack([u + du, v + dv], -1)).ray
            total += _shade(ray, T_cb, board_picture, px_per_mm)
    noisy = total / 9 + random.normal(0, grey_sigma, total.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


def board_points(corners_px, board_picture, px_per_mm):
    """Return the (N, 3) points in the board's frame of positions in the board's picture."""
    size = np.array(board_picture.shape[1::-1])
    xy = (np.asarray(corners_px, float) + 0.5 - size / 2) / px_per_mm
    return np.concatenate([xy, np.zeros((len(xy), 1))], 1)


def chessboard_picture(columns, rows, square_px, border_px):
    """Return the picture of a chessboard and the positions of its inner corners, columns × rows, in it."""
    squares = (np.add.outer(np.arange(rows + 1), np.arange(columns + 1)) % 2) * 200 + 30
    face = np.kron(squares, np.ones((square_px, square_px)))
    picture = np.pad(face, border_px, constant_values=230).astype(np.uint8)
    corners = border_px - 0.5 + square_px * (grid(columns, rows, 1.0)[:, :2] + 1)
    return picture, corners


def _shade(ray, T_cb, picture, px_per_mm):
    normal, origin = T_cb[:3, 2], T_cb[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (normal @ origin) / (ray @ normal)
        local = (ray * distance[..., None] - origin) @ T_cb[:3, :2]
    size = np.array(picture.shape[1::-1])
    xy = np.where((distance > 0)[..., None], local * px_per_mm + size / 2 - 0.5, -10).astype(np.float32)
    sampled = cv2.remap(picture, np.ascontiguousarray(xy), None, cv2.INTER_LINEAR, borderValue=90)
    return np.asarray(sampled, float)
