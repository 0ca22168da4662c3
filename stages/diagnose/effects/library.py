"""All effects by name, and their predictions for ring, texture and encoder readings."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.catalogue import effect
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape, SumOfLaws, Travel
from stages.diagnose.effects.camera import CAMERA_MODELS
from stages.diagnose.effects.laser import LASER_MODELS, PHOTOMETRIC_MODELS
from stages.diagnose.effects.pose import POSE_MODELS
from stages.diagnose.effects.ring_geometry import turned_about_z
from stages.diagnose.effects.window import WINDOW_MODELS

_MODELS = (*LASER_MODELS, *CAMERA_MODELS, *WINDOW_MODELS, *POSE_MODELS, *PHOTOMETRIC_MODELS)
LIBRARY: Mapping[str, EffectModel] = MappingProxyType({model.name: model for model in _MODELS})

# Unknown in every inspection that is asked about the instrument: in texture and readings, a clock that is
# late seems an error of the instrument.
OF_READINGS = ("time_offset", "encoder_backlash")

# Effects of the catalogue whose influence on positions cannot be predicted, with the reason.
NOT_PREDICTED: Mapping[str, str] = MappingProxyType({
    "slope_bias": "needs the wall's slope and gloss everywhere: seen in the profile's skewness and in glints",
    "ghost_ring": "a second peak, seen in the profile; its pull on the line depends on the estimator",
    "tube_ghost": "a second peak, seen in the profile; its pull on the line depends on the estimator",
    "speckle": "random: it is the noise floor",
    "saturation": "shifts only a skewed profile, by its skewness: seen in the flat top of the profile",
    "gamma": "shifts only a skewed profile, by its skewness: seen in the width of the profile",
    "ambient_light": "needs the stray light's slope at every point: seen in the profile's floor",
    "fixed_pattern": "random from pixel to pixel: seen by stacking residuals in the sensor's frame",
    "dust": "takes light away from a part of the ring: seen in the line's brightness",
})  # fmt: skip
_ROUNDS = 3


def ring_shift_px(model: EffectModel, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
    """Return by how much (M,), px, the ring is found farther out in the image, at the same image azimuth.

    The sheet's new intersection with the wall is computed in the half-plane of each point's azimuth; the
    image shift is taken there, and read along the image radius with the ring's own inclination. A shift
    around the image brings another place of the wall to a pixel's azimuth: the shift of that place counts.
    """
    ring = points.ring
    moved = points
    for _ in range(_ROUNDS):
        sheet = model.sheet_shift_mm(moved, shape, amplitude)
        wall = model.wall_shift_mm(moved, shape, amplitude)
        if not (np.any(sheet) or np.any(wall)):
            break
        xyz = points.xyz_c + sheet[:, None] * ring.per_sheet_c + wall[:, None] * ring.per_wall_c
        moved = _moved(points, xyz)
    shift = model.image_shift_px(moved, shape, amplitude)
    around = ring.around(shift)
    if np.any(around):
        turn_rad = around / ring.rho_px
        elsewhere = model.image_shift_px(_turned(moved, -turn_rad), shape, amplitude)
        shift = turned_about_z(elsewhere, turn_rad)
    found = ring.read_small(moved.uv - points.uv + shift) + around**2 / (2 * ring.rho_px)
    return found + model.line_shift_px(moved, shape, amplitude)


def texture_shift_px(model: EffectModel, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
    """Return the shift (M, 2) of the image of wall points along u and v, px."""
    wall = model.wall_shift_mm(points, shape, amplitude)
    moved = _moved(points, points.xyz_c + wall[:, None] * points.normal_c) if np.any(wall) else points
    return np.asarray(moved.uv - points.uv + model.image_shift_px(moved, shape, amplitude))


def columns(model: EffectModel, points: ImagePoints, shape: Shape) -> Float:
    """Return derivatives (M, Q) of `ring_shift_px` by the amplitudes, at zero, for points on the line."""
    return _by_course(_line_columns, model, points, shape)


def texture_columns(model: EffectModel, points: ImagePoints, shape: Shape) -> Float:
    """Return derivatives (M, 2, Q) of `texture_shift_px` with respect to the amplitudes, at zero."""
    return _by_course(_texture_columns, model, points, shape)


def _by_course(
    made: Callable[[EffectModel, ImagePoints, Shape], Float], model: EffectModel, points: ImagePoints,
    shape: Shape,
) -> Float:  # fmt: skip
    """Return an effect's columns; those of a law, shared by its courses, are computed once."""
    factored = model.factored(points, shape)
    if factored is None and isinstance(model, SumOfLaws) and not model.linear:
        return made(model, points, shape)
    parts, static, own = factored or ((), model, shape)
    key = (static.name, own, made is _line_columns)
    if key not in points.patterns:
        points.patterns[key] = made(static, points, own)
    pattern = points.patterns[key]
    wide = [-1, *[1] * (pattern.ndim - 1)]
    return np.concatenate([p.reshape(wide) * pattern for p in parts], -1) if parts else pattern


def _line_columns(model: EffectModel, points: ImagePoints, shape: Shape) -> Float:
    ring = points.ring
    sheet_px, wall_px = ring.read_move(ring.per_sheet_c), ring.read_move(ring.per_wall_c)

    def small(amplitude: Float) -> Float:
        return (
            ring.read_small(model.image_shift_px(points, shape, amplitude))
            + sheet_px * model.sheet_shift_mm(points, shape, amplitude)
            + wall_px * model.wall_shift_mm(points, shape, amplitude)
            + model.line_shift_px(points, shape, amplitude)
        )

    return _slopes(small, model)


def _texture_columns(model: EffectModel, points: ImagePoints, shape: Shape) -> Float:
    per_wall = np.einsum("mij,mj->mi", points.ring.by_point, points.normal_c)

    def small(amplitude: Float) -> Float:
        wall = model.wall_shift_mm(points, shape, amplitude)
        return np.asarray(model.image_shift_px(points, shape, amplitude) + wall[:, None] * per_wall)

    return _slopes(small, model)


def reading_columns(model: EffectModel, travel: Travel, shape: Shape) -> Float:
    """Return derivatives (N, Q) of the encoder's reading, mm, with respect to the amplitudes, at zero."""
    return _slopes(partial(model.reading_shift_mm, travel, shape), model)


def _slopes(prediction: Callable[[Float], Float], model: EffectModel) -> Float:
    """Return the central differences (..., Q) over ± the plausible size of each amplitude."""
    each = []
    for step in np.diag([a.plausible for a in model.amplitudes]):
        back = 0.0 if model.linear else prediction(-step)
        each.append((prediction(step) - back) / (step.sum() * (1 if model.linear else 2)))
    return np.stack(each, axis=-1)


def _moved(points: ImagePoints, xyz_c: Float) -> ImagePoints:
    uv = points.uv + points.probe.camera.project(xyz_c).uv - points.projected_uv
    return replace(points, xyz_c=xyz_c, uv=np.asarray(uv))


def _turned(points: ImagePoints, angle_rad: Float) -> ImagePoints:
    """Return the points, with the wall, turned about the optical axis by angles (M,)."""
    centre, each = points.probe.camera.centre_px, (points.xyz_c, points.normal_c, points.along_c)
    xyz_c, normal_c, along_c = (turned_about_z(v, angle_rad) for v in each)
    uv = centre + turned_about_z(points.uv - centre, angle_rad)
    return replace(points, uv=uv, xyz_c=xyz_c, normal_c=normal_c, along_c=along_c)


def without(names: Collection[str]) -> Mapping[str, EffectModel]:
    """Return the library without some effects, to test how unknown effects are treated.

    Raises
    ------
    InputError
        When a name is not in the catalogue.
    """
    left_out = {effect(name).name for name in names}
    return MappingProxyType({name: model for name, model in LIBRARY.items() if name not in left_out})
