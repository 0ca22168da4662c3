"""Projects a tile's pixels into a view, with the brightness of white wall and the weight of each sample."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.geometry.image_places import ImagePlaces, clear_of
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from stages.texture.grid import NODE_PX
from stages.texture.light import LEAST_LIGHT, LightField
from stages.texture.surface import SurfacePatch
from stages.texture.views import sheet_distance_mm

_BORDER_PX = 3.0


@dataclass(frozen=True)
class TileProjection:
    """Per pixel of a tile: ``uv`` (n, m, 2), ``inverse_brightness`` (n, m) and ``weight`` (n, m), 0 to 1.

    ``block_uv`` (n / 2, m / 2, 2) are the middles of blocks of 2 by 2 pixels.
    """

    uv: Float32
    block_uv: Float32
    inverse_brightness: Float32
    weight: Float32


def project_tile(
    patch: SurfacePatch,
    T_cp: Float,
    probe: Probe,
    light: LightField,
    gain: float,
    reach_mm: float,
    gap_mm: float,
    left_out: ImagePlaces,
) -> TileProjection:
    """Project the nodes of a tile exactly and the pixels between them by linear interpolation.

    Parameters
    ----------
    patch
        The wall at the nodes of `FlatGrid.node_patch`.
    T_cp, probe, light, gain
        Pose, instrument, light over the image, and exposure of the view.
    reach_mm
        Distance from the laser sheet at which the weight is zero.
    gap_mm
        Half width of the band around the laser line that is not used; 0 if the laser was off.
    left_out
        Places of the image that are not used.
    """
    xyz_c = transform(T_cp, patch.xyz_p)
    uv, valid = probe.camera.project(xyz_c)
    width, height = probe.camera.image_size
    inside = (uv > _BORDER_PX) & (uv < np.array([width, height]) - 1 - _BORDER_PX)
    brightness = gain * light.brightness(xyz_c, patch.normal_p @ T_cp[:3, :3].T)
    from_sheet = sheet_distance_mm(probe.laser, xyz_c)
    lit = valid & inside.all(-1) & (brightness > LEAST_LIGHT)
    usable = cv2.erode(lit.astype(np.uint8), np.ones((3, 3)))
    worth = np.clip(1 - (from_sheet / reach_mm) ** 2, 0, 1) ** 2 * _quality(uv, brightness)
    weight = _enlarge(worth * usable)
    if gap_mm > 0:
        weight = np.where(np.abs(_enlarge(from_sheet)) < gap_mm, np.float32(0), weight)
    node_uv = np.where(valid[..., None], uv, -100.0)
    seen_at = _enlarge(node_uv)
    if left_out:
        weight = np.where(clear_of(left_out, seen_at), weight, np.float32(0))
    inverse = _enlarge(1 / np.maximum(brightness, LEAST_LIGHT))
    return TileProjection(seen_at, _enlarge(node_uv, NODE_PX // 2), inverse, weight)


def _quality(uv: Float, brightness: Float) -> Float:
    """Return image pixels per wall area times brightness, relative to the best: shot noise and sharpness."""
    down, right = np.gradient(uv, axis=0), np.gradient(uv, axis=1)
    density = np.abs(down[..., 0] * right[..., 1] - down[..., 1] * right[..., 0])
    quality = np.nan_to_num(density * brightness)
    return np.asarray(quality / max(float(quality.max()), 1e-12))


def _enlarge(nodes: Float, by: int = NODE_PX) -> Float32:
    """Return node values (n, m) or (n, m, 2) ``by`` times as fine, linearly; the outer nodes are cut off."""
    big = cv2.resize(nodes.astype(np.float32), None, fx=by, fy=by, interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(big[by:-by, by:-by])
