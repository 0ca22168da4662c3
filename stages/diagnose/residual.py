"""Rings compared with their places according to texture alone or fiducials alone, under one instrument."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Illumination
from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.field.reduce import reduced, rings_after
from stages.diagnose.field.run import FieldRun
from stages.diagnose.field.run import ring_points as field_points
from stages.diagnose.field.system import ENCODER_SCALE, field_system
from stages.diagnose.gauge.equations import RING
from stages.diagnose.gauge.fit import Fit, fit
from stages.diagnose.gauge.heldout import at_one_azimuth, turns_apart
from stages.diagnose.gauge.linearise import ring_mm_per_px
from stages.diagnose.gauge.points import Moving
from stages.diagnose.gauge.points import ring_points as gauge_points
from stages.diagnose.gauge.run import GaugeRun, Term

AZIMUTHS = 72
WALL_STEP_MM = 2.0
# Factor on the rings' weight: so small that fiducials determine the poses, and large enough for rings to
# determine the effects' sizes. Debt: data/debts.md.
_GAUGE_RELAXED = 1e-4
_OUTLIER = 0.1
# Poses are carried over at most this many frames.
_NEAR = 2
# Factor on the rings' σ, so large that texture alone determines poses and wall.
_FIELD_RELAXED = 1e3

# Weight of a pair of an end with what is beyond it, negligible unless its rings have no other pair.
_ELSE = 1e-6
_SINKHORN_ROUNDS = 100


@dataclass(frozen=True)
class RingResidual:
    """By how much ring bins are farther out than texture, poses and the pipe predict.

    Attributes
    ----------
    source : str
        ``field`` or ``gauge``.
    frame : (M,) int
        Frame numbers.
    azimuth_c_rad, azimuth_p_rad, distance_mm : (M,)
        Azimuth in C; azimuth and distance of the wall point in P.
    uv : (M, 2)
        Image of the bin, px.
    residual_mm, residual_px : (M,)
        As radius, and as outward shift in the image.
    usable : (M,) bool
        False where the adjustment found an outlier.
    """

    source: str
    frame: Int
    azimuth_c_rad: Float
    azimuth_p_rad: Float
    distance_mm: Float
    uv: Float
    residual_mm: Float
    residual_px: Float
    usable: Bool

    @property
    def rms_px(self) -> float:
        """RMS of the usable residuals, px."""
        return float(np.sqrt(np.mean(self.residual_px[self.usable] ** 2)))

    @property
    def floor_px(self) -> float:
        """RMS, px, of what rings do not repeat at one azimuth of the image on other wall; NaN if unknown.

        It does not include the slowly varying error of a ring's middle from texture alone: 0.05 to 0.08 px in
        four sound inspections, with a σ of 0.09 to 0.11 px. It includes a part of what changes within a few
        mm.
        """
        own = self.usable
        azimuth, frame, along = self.azimuth_c_rad[own], self.frame[own], self.distance_mm[own]
        return float(np.sqrt(_unrepeated(self.residual_px[own], azimuth, frame, along)))

    def over_frames(self, frames: Int) -> Float:
        """Return the mean residual, mm, over (F, `AZIMUTHS`) frames and azimuth in C; NaN where none is."""
        inside = self.usable & np.isin(self.frame, frames)
        row = np.searchsorted(frames, self.frame[inside])
        return _mean(row, self.azimuth_c_rad[inside], self.residual_mm[inside], len(frames))

    def over_wall(self, distance_mm: Float) -> Float:
        """Return the mean residual, mm, over (S, `AZIMUTHS`) distance and azimuth in P; NaN where none is."""
        row = np.round((self.distance_mm - distance_mm[0]) / WALL_STEP_MM).astype(np.int64)
        inside = self.usable & (row >= 0) & (row < len(distance_mm))
        return _mean(row[inside], self.azimuth_p_rad[inside], self.residual_mm[inside], len(distance_mm))


def azimuths_rad() -> Float:
    """Return the azimuths of the middles (`AZIMUTHS`,) of the columns."""
    return np.asarray((np.arange(AZIMUTHS) + 0.5) / AZIMUTHS * 2 * np.pi - np.pi)


def wall_distances_mm(residual: RingResidual) -> Float:
    """Return the distances of the rows (S,)."""
    low, high = float(residual.distance_mm.min()), float(residual.distance_mm.max())
    return np.arange(np.floor(low), high + WALL_STEP_MM, WALL_STEP_MM)


def _mean(row: Int, azimuth_rad: Float, values: Float, rows: int) -> Float:
    """Return the means (``rows``, `AZIMUTHS`) of values (M,); NaN where there are none."""
    column = np.floor((azimuth_rad + np.pi) / (2 * np.pi) * AZIMUTHS).astype(np.int64) % AZIMUTHS
    cell = row * AZIMUTHS + column
    count, total = (np.bincount(cell, w, rows * AZIMUTHS) for w in (None, values))
    mean: Float = np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)
    return mean.reshape(rows, AZIMUTHS)


def _unrepeated(value: Float, azimuth_rad: Float, frame: Int, along_mm: Float) -> float:
    """Return the variance of the part of ring bins (M,) that does not repeat at one azimuth on other wall.

    Bins near an end have a partner on one side only. Pairs are weighted so that all bins count equally, since
    noise may be larger at the ends. An effect that begins near an end would be in every pair of that end with
    the rest of the run: bins there are compared with one another, half as far apart. NaN without pairs.
    """
    turn, apart = turns_apart(frame, along_mm)
    half, last = max(apart // 2, 1), int(turn.max(initial=0))
    end = np.where(turn < 2 * half, 1, np.where(turn > last - 2 * half, 2, 0))
    near = at_one_azimuth(azimuth_rad, turn, half, 2 * half)
    far = [at_one_azimuth(azimuth_rad, turn, places, 2 * apart) for places in (apart, 2 * apart)]
    first, second = (np.concatenate(each) for each in zip(near, *far, strict=True))
    is_near = np.arange(len(first)) < len(near[0])
    wanted = (end[first] == end[second]) & ((end[first] > 0) == is_near)
    weight = np.where(wanted, 1.0, np.where(is_near, 0.0, _ELSE))
    if not weight.any():
        return float("nan")
    weight = _each_once(first, second, weight, len(value))
    return float(np.average((value[second] - value[first]) ** 2, weights=weight)) / 2


def _each_once(first: Int, second: Int, weight: Float, count: int) -> Float:
    """Return weights (P,) of pairs such that all bins in any pair count equally (Sinkhorn & Knopp 1967)."""
    each = np.ones(count)
    for _ in range(_SINKHORN_ROUNDS):
        both = weight * each[first] * each[second]
        total = np.bincount(first, both, count) + np.bincount(second, both, count)
        each /= np.sqrt(np.where(total > 0, total, 1.0))
    return np.asarray(weight * each[first] * each[second])


def rings_against_fiducials(
    run: GaugeRun, start: Unknowns, terms: Sequence[Term], frames: Int
) -> tuple[RingResidual, RingResidual]:
    """Return the rings' residuals without and with effects, with poses from fiducials and encoder.

    Parameters
    ----------
    frames : (N,) int
        Numbers of all frames.

    Raises
    ------
    numpy.linalg.LinAlgError
        When fiducials do not determine the poses.
    """
    relaxed = replace(run, ring_weight=_GAUGE_RELAXED * run.ring_weight)
    before = _gauge_residual(run, fit(relaxed, start, ()), frames)
    after = _gauge_residual(run, fit(relaxed, start, terms), frames) if terms else before
    return before, after


def _gauge_residual(run: GaugeRun, found: Fit, frames: Int) -> RingResidual:
    equations = found.linearised.equations
    ring = equations.kind == RING
    residual = equations.residual[ring]
    moving = Moving.of(found.state.T_pc, run.time_s)
    points = gauge_points(found.state, run.rings, run.time_s, moving, run.width_px)
    assert points.distance_mm is not None
    usable = equations.weight[ring] > _OUTLIER * np.median(equations.weight[ring])
    seen = np.unique(run.edges.frame)
    usable &= np.min(np.abs(run.rings.frame[:, None] - seen), axis=1) <= _NEAR
    return RingResidual(
        "gauge", frames[run.rings.frame], points.azimuth_rad, points.azimuth_p_rad, points.distance_mm,
        run.rings.uv, residual * ring_mm_per_px(points), residual, usable,
    )  # fmt: skip


def rings_against_texture(
    run: FieldRun, terms: Sequence[tuple[EffectModel, Shape, Float]] = (), encoder_share: float = 0.0
) -> RingResidual:
    """Return the rings' residual with the probe as stated and poses from texture.

    The pipe's radius is not known in advance: the mean residual is subtracted. Ring frames before the first
    lit frame and after the last have no pose from texture and are left out.

    Parameters
    ----------
    terms
        Effects, their shapes and amplitudes (Q,), whose shift is subtracted to first order.

    Raises
    ------
    numpy.linalg.LinAlgError
        When texture alone does not determine the poses.
    """
    system = field_system(run, [(model, shape) for model, shape, _ in terms], np.zeros(0, np.int64))
    rings = system.rows[0]
    relaxed = replace(system, rows=(replace(rings, sigma=_FIELD_RELAXED * rings.sigma), *system.rows[1:]))
    # From the instrument as this run would adjust it back to the stated one.
    to = -system.value
    to[system.names.index(ENCODER_SCALE)] += encoder_share
    if terms:
        amplitude = np.concatenate([a for _, _, a in terms])
        to[len(to) - len(amplitude) :] = amplitude
    residual = rings_after(rings, reduced(relaxed, len(run.state.T_pc)), to)
    points = field_points(run)
    assert points.distance_mm is not None
    frame, weight = run.recording.frames.frame[run.measured.rings.frame], run.equations.rings.weight
    usable = weight > _OUTLIER * np.median(weight)
    lit = run.recording.frames.of(Illumination.LED, Illumination.BOTH)
    usable &= (frame >= lit[0]) & (frame <= lit[-1])
    residual = residual - np.mean(residual[usable])
    return RingResidual(
        "field", frame, points.azimuth_rad, points.azimuth_p_rad, points.distance_mm, points.uv,
        residual, residual / ring_mm_per_px(points), usable,
    )  # fmt: skip
