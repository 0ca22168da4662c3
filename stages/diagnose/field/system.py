"""The equations of a field recording, with columns for the stated instrument and for effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.motion_priors import smooth_motion_rows
from pipeline.adjustment.robust import Squares
from pipeline.adjustment.rows import LandmarkRows, Rows
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import inverse, transform
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape, Travel
from stages.diagnose.effects.library import columns, reading_columns, texture_columns
from stages.diagnose.field.run import FieldRun, distance_mm, ring_points, speed_mm_s, texture_points
from stages.diagnose.inference import INSTRUMENT, Column
from stages.motion import MATCH_BIASES, EncoderReadings, State, residuals

Asked = Sequence[tuple[EffectModel, Shape]]
_RADIUS_SHARE = 0.1
_SLIPPED_MM = 1e3
_MORE_BIASES = 2
_MIDDLE_RAD, _SPAN_RAD = 1.0, 0.35  # middle and half range of the polar angles of tracked texture
_HOLD, _SCALE_SIGMA = 1e3, 0.002
ENCODER_SCALE = Column(INSTRUMENT, "encoder_scale")
# The pipe's own shape and the camera's motion are unknowns of every field recording.
OWN = frozenset({"ovality", "pipe_bend", "probe_vibration"})


@dataclass(frozen=True)
class FieldSystem:
    """Equations of a field recording.

    Attributes
    ----------
    rows : tuple of Rows
        Without landmarks: first the rings, then the rest.
    names : tuple of Column
        The last columns of the border; those before are the recording's own unknowns.
    value : (K,)
        Point of linearisation of the named columns, true − stated.
    held : (K,)
        Artificial information that keeps undetermined columns solvable; to be subtracted again.
    """

    rows: tuple[Rows, ...]
    texture: LandmarkRows
    names: tuple[Column, ...]
    value: Float
    held: Float

    @property
    def border(self) -> int:
        """Number of all columns of the border."""
        return int(self.rows[0].by_border.shape[1])


def field_system(run: FieldRun, asked: Asked, slips: Int) -> FieldSystem:
    """Return the equations about the run's state.

    Parameters
    ----------
    asked
        Effects and shapes for which columns are wanted.
    slips : (J,) int
        Frames before which the encoder's reading jumps: it is not used there.
    """
    known = np.flatnonzero(np.diag(run.probe.covariance) > 0)
    names = [Column(INSTRUMENT, run.probe.parameter_names[k]) for k in known]
    names.append(ENCODER_SCALE)
    names += [Column(model.name, a.name, shape) for model, shape in asked for a in model.amplitudes]
    state, size = run.state, len(names)
    instrument = run.measured.unsure @ state.instrument[: run.measured.unsure.shape[1]]
    value = np.zeros(size)
    value[: len(known)] = instrument[known]
    rows = [_ring_rows(run, known, asked, size)]
    rows += [_widened(row, state, size) for row in _pose_rows(run)]
    if run.encoder is not None:
        rows += _encoder_rows(run, run.encoder, len(known), asked, size, slips)
    else:
        rows.append(_widened(residuals.no_slip_rows(state), state, size))
    rows.append(_own_priors(state, size))
    plausible = [a.plausible for model, _ in asked for a in model.amplitudes]
    sigma = np.sqrt(np.diag(run.probe.covariance))[known]
    held = (_HOLD * np.concatenate([sigma, [_SCALE_SIGMA], plausible])) ** -2.0
    border = _own_size(state) + size
    rows.append(_priors(np.arange(border - size, border), np.zeros(size), held**-0.5, border))
    return FieldSystem(tuple(rows), _texture_rows(run, known, asked, size), tuple(names), value, held)


def _pose_rows(run: FieldRun) -> list[Rows]:
    state = run.state
    return [
        residuals.origin_rows(state),
        smooth_motion_rows(state.T_pc, run.measured.time_s, run.measured.smooth_sigma, state.border_size),
        residuals.turn_rows(state, run.parameters.turn_sigma_rad),
        residuals.axis_rows(state, run.parameters.axis_bend_sigma),
    ]


def _ring_rows(run: FieldRun, known: Int, asked: Asked, size: int) -> Rows:
    """Return the run's ring equations; a line found farther out makes the wall appear farther out."""
    rows, points = run.equations.rings, ring_points(run)
    T = run.state.T_pc[run.measured.rings.frame]
    by_pixel, by_parameters = run.probe.triangulate_jacobian(points.uv)
    normal = residuals.surface(run.state, transform(T, points.xyz_c))[1]
    normal_c = np.einsum("mi,mij->mj", normal, T[:, :3, :3])
    by_shift = -np.einsum("mi,mij,mj->m", normal_c, by_pixel, points.outward)
    of_probe = np.einsum("mj,mjp->mp", normal_c, by_parameters[:, :, known])
    of_effects = [by_shift[:, None] * columns(model, points, shape) for model, shape in asked]
    named = np.concatenate([of_probe, np.zeros((len(of_probe), 1)), *of_effects], axis=1)
    return _usable(_widened(rows, run.state, size), named)


def _texture_rows(run: FieldRun, known: Int, asked: Asked, size: int) -> LandmarkRows:
    rows, points = run.equations.texture, texture_points(run)
    camera = run.measured.camera_at(run.state)
    tracks = run.measured.tracks
    xyz_c = transform(inverse(run.state.T_pc[tracks.frame]), run.state.xyz_p[tracks.landmark])
    by_parameters = camera.project_jacobian(xyz_c).by_parameters
    of_camera = by_parameters[:, :, known[known < by_parameters.shape[2]]]
    of_others = np.zeros((*of_camera.shape[:2], len(known) + 1 - of_camera.shape[2]))
    of_effects = [
        np.zeros((len(points.uv), 2, len(model.amplitudes)))
        if model.name in OWN
        else texture_columns(model, points, shape)
        for model, shape in asked
    ]
    named = np.concatenate([of_camera, of_others, *of_effects], axis=2)
    bad = ~np.isfinite(named).all((1, 2)) | ~rows.by_pose.any((1, 2))
    named[bad] = 0.0
    surface = np.zeros((len(rows.surface_residual), _own_size(run.state) + size))
    surface[:, : _shape_size(run.state)] = rows.surface_by_border[:, : _shape_size(run.state)]
    matching = [rows.by_instrument[:, :, -MATCH_BIASES:], _more_biases(run, points)]
    return replace(
        rows, by_instrument=np.concatenate([*matching, named], 2),
        sigma=np.where(bad, np.inf, rows.sigma), surface_by_border=surface,
    )  # fmt: skip


def _more_biases(run: FieldRun, points: ImagePoints) -> Float:
    """Return (M, 2, 2) radial matching errors that are quadratic and cubic in the polar angle.

    The adjustment allows for errors at knots, linear between them; effects of the lens show in the rest.
    """
    t = (points.theta - _MIDDLE_RAD) / _SPAN_RAD
    curve = np.stack([1.5 * t**2 - 0.5, 2.5 * t**3 - 1.5 * t], -1) * run.parameters.match_bias_px
    return np.asarray(points.outward[:, :, None] * curve[:, None, :])


def _encoder_rows(
    run: FieldRun, encoder: EncoderReadings, scale_at: int, asked: Asked, size: int, slips: Int
) -> list[Rows]:
    """Return the equations distance seen = reading − effects on it + slip, and slip varying slowly."""
    state = run.state
    steady = replace(state, globals=np.append(state.globals[:3], 1.0), slip=np.zeros(len(state.slip)))
    reading, creep = residuals.encoder_rows(steady, encoder, run.parameters.encoder_slip_sigma_mm)
    travel = Travel(run.measured.time_s, distance_mm(run), speed_mm_s(run))
    of_probe = np.zeros((len(reading.residual), scale_at))
    of_effects = [reading_columns(model, travel, shape) for model, shape in asked]
    named = np.concatenate([of_probe, encoder.distance_mm[:, None], *of_effects], axis=1)
    reading.by_border[:, 3] = 0.0
    sigma = creep.sigma.copy()
    sigma[np.clip(slips - 1, 0, len(sigma) - 1)] = _SLIPPED_MM
    plain = replace(creep, sigma=sigma, loss=Squares())
    return [_usable(_widened(reading, state, size), named), _widened(plain, state, size)]


def _own_priors(state: State, size: int) -> Rows:
    """Return the priors of the pipe's radius and ovality, and of matching errors."""
    own = np.r_[0:4, _shape_size(state) : _own_size(state)]
    sigma = np.r_[
        np.full(3, _RADIUS_SHARE * state.nominal_radius_mm), 1.0, np.ones(MATCH_BIASES + _MORE_BIASES)
    ]
    value = np.r_[
        state.globals - np.array([state.nominal_radius_mm, 0, 0, 1.0]), state.instrument[-MATCH_BIASES:]
    ]
    value = np.r_[value, np.zeros(_MORE_BIASES)]
    return _priors(own, value, sigma, _own_size(state) + size)


def _priors(place: Int, value: Float, sigma: Float, border: int) -> Rows:
    """Return priors (K,) of zero for columns of the border, with their present values and 1 σ."""
    none = np.zeros((len(place), 0), np.int64)
    return Rows(none, np.zeros((len(place), 0, BLOCK)), np.eye(border)[place], value, sigma)


def _shape_size(state: State) -> int:
    """Return the number of border columns of the pipe."""
    return state.border_size - len(state.instrument)


def _own_size(state: State) -> int:
    """Return the number of columns of the recording alone: the pipe's and those of matching."""
    return _shape_size(state) + MATCH_BIASES + _MORE_BIASES


def _widened(rows: Rows, state: State, size: int) -> Rows:
    """Return rows with the named columns, filled with zeros, in place of the instrument's corrections."""
    wide = np.zeros((len(rows.residual), _own_size(state) + size))
    wide[:, : _shape_size(state)] = rows.by_border[:, : _shape_size(state)]
    return replace(rows, by_border=wide)


def _usable(rows: Rows, named: Float) -> Rows:
    """Return rows with the named columns; rows without a valid prediction get no weight."""
    bad = np.asarray(~np.isfinite(named).all(1))
    rows.by_border[:, rows.by_border.shape[1] - named.shape[1] :] = np.where(bad[:, None], 0.0, named)
    return replace(rows, sigma=np.where(bad, np.inf, rows.sigma))
