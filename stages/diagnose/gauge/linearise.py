"""Measurements of a gauge run as equations about a state and a few effects at their present size.

Rings count in pixels of the image, as fiducials do: a lens that maps a millimetre to more pixels makes the
same noise fewer millimetres, so that in millimetres it would fit better than the true one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from pipeline.adjustment.motion_priors import smooth_motion_rows
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float, Int
from pipeline.recording.base import Encoder
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.geometry import BoreRings
from stages.calibrate.gauge.state import ENCODER, Unknowns
from stages.calibrate.gauge.terms import edge_rows, expected_ring, ring_residual, ring_rows, wall_cells
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape, Travel
from stages.diagnose.effects.library import (
    columns,
    reading_columns,
    ring_shift_px,
    texture_columns,
    texture_shift_px,
)
from stages.diagnose.gauge.elimination import POSE
from stages.diagnose.gauge.equations import BY_ROW, EDGE, RING, Equations, InCourses, of_no_edge
from stages.diagnose.gauge.equations import ENCODER as ENCODER_ROW
from stages.diagnose.gauge.points import (
    BASELINE_SIZE,
    Moving,
    edge_baseline,
    edge_points,
    ring_baseline,
    ring_points,
)
from stages.diagnose.gauge.run import GaugeRun, Linearised, Term

_ROUNDS = 2
_ENCODER_SIGMA_MM = 1.0
# Encoder readings this many frames apart are taken as independent. Debt: data/debts.md.
_ENCODER_CELL = 8


def linearise(run: GaugeRun, state: Unknowns, terms: Sequence[Term]) -> Linearised:
    """Return the equations with columns for globals and terms."""
    run.watch()
    moving = Moving.of(state.T_pc, run.time_s)
    edges, edge_at = _without_edge_shift(run, state, moving, terms)
    ring_at = ring_points(state, _on_bore(run, state), run.time_s, moving, run.width_px)
    # The camera's distance and speed along the gauge, from which the encoder's readings are predicted.
    travel = Travel(run.time_s, state.T_pc[:, 2, 3], moving.speed_mm_s)
    if terms:
        ring_at = replace(ring_at, shifted_px=_ring_shift(ring_at, terms) - _light_shift(ring_at, terms))
    shift = _ring_shift(ring_at, terms)
    rings = replace(run.rings, uv=run.rings.uv - shift[:, None] * run.rings.outward)
    residual = ring_residual(state, rings, rings.uv)
    parts = [_edge_part(run, state, edges, edge_at, terms)]
    parts.append(_ring_part(run, state, rings, ring_at, residual, terms))
    if run.encoder is not None:
        parts.append(_encoder_part(run, run.encoder, state, travel, terms))
    joined: dict[str, Any] = {name: np.concatenate([getattr(p, name) for p in parts]) for name in BY_ROW}
    smooth = smooth_motion_rows(state.T_pc, run.time_s, run.motion_sigma, 0)
    motion = replace(smooth, by_frame=np.ascontiguousarray(smooth.by_frame[..., :POSE]))
    return Linearised(Equations(**joined, edges=state.layout.marker), motion, ring_at, edge_at, travel)


def _ring_shift(points: ImagePoints, terms: Sequence[Term]) -> Float:
    """Return the outward shift (M,), px, of the line by all terms."""
    each = (ring_shift_px(t.model, points, *t.at(t.amplitude)) for t in terms)
    return np.asarray(sum(each, np.zeros(len(points.uv))))


def _light_shift(points: ImagePoints, terms: Sequence[Term]) -> Float:
    """Return the part of it by light, which depends on the place where the line would lie without it."""
    each = (t.model.line_shift_px(points, *t.at(t.amplitude)) for t in terms)
    return np.asarray(sum(each, np.zeros(len(points.uv))))


def beside(run: GaugeRun, state: Unknowns, at: Linearised, model: EffectModel, shape: Shape) -> Linearised:
    """Return the linearisation with an additional effect of size zero as the last term."""
    return replace(at, equations=asking(run, state, at, [(model, shape)]))


def asking(
    run: GaugeRun, state: Unknowns, at: Linearised, asked: Sequence[tuple[EffectModel, Shape]],
    with_baseline: bool = False,
) -> Equations:  # fmt: skip
    """Return equations with additional columns for the effects asked about and for the baseline.

    Measurements without a valid prediction get no weight.
    """
    return in_courses(run, state, at, asked, with_baseline).in_full()


def in_courses(
    run: GaugeRun, state: Unknowns, at: Linearised, asked: Sequence[tuple[EffectModel, Shape]],
    with_baseline: bool = False,
) -> Equations:  # fmt: skip
    """Return the same equations with one column for each law, whatever its courses."""
    run.watch()
    equations, own = at.equations, at.equations.by_global.shape[1]
    laws, courses = at.in_courses(asked, len(run.time_s))
    first = own + sum(len(law.amplitudes) for law, _ in laws)
    end = first + BASELINE_SIZE * with_baseline
    by_global = np.zeros((len(equations.frame), end))
    by_global[:, :own] = equations.by_global
    _ask(run, state, at, laws, by_global[:, own:first])
    bad = ~np.isfinite(by_global[:, own:first]).all(1) | ~courses.known[equations.kind, equations.frame]
    if with_baseline:
        by_global[:, first:] = _baseline(run, at)
    by_global[bad] = 0.0
    baseline = InCourses.plain(np.arange(first, end), len(run.time_s))
    return replace(
        equations, by_global=by_global, weight=np.where(bad, 0.0, equations.weight),
        courses=InCourses.joined([courses.where_known(), baseline]),
    )  # fmt: skip


def _ask(
    run: GaugeRun, state: Unknowns, at: Linearised, asked: Sequence[tuple[EffectModel, Shape]], out: Float,
) -> None:  # fmt: skip
    """Write the derivatives of the residuals by the effects' amplitudes to ``out`` (M, Q)."""
    edges, rings = len(at.edges.uv), len(at.edges.uv) + len(at.rings.uv)
    first = 0
    for model, shape in asked:
        own = slice(first, first + len(model.amplitudes))
        out[:edges, own] = _across(texture_columns(model, at.edges, shape), run.edges)
        out[edges:rings, own] = -columns(model, at.rings, shape)
        if run.encoder is not None:
            out[rings:, own] = state.encoder[0] * reading_columns(model, at.travel, shape)
        first = own.stop


def _across(shift: Float, edges: Edges) -> Float:
    """Return the components of shifts (E, 2, ...) of edges along their normals."""
    return np.asarray(np.einsum("mi...,mi->m...", shift, edges.normal))


def _baseline(run: GaugeRun, at: Linearised) -> Float:
    """Return the derivatives (M, 38) of the residuals by the baseline's patterns, in px."""
    on_edges = edge_baseline(at.edges, run.edges.normal)
    # The residual of a ring decreases with its outward shift.
    on_rings = -ring_baseline(at.rings)
    rest = len(at.equations.frame) - len(on_edges) - len(on_rings)
    # At the edge of the camera model's domain the derivative does not exist; such points are left out.
    return np.nan_to_num(block_diag(on_edges, on_rings, np.zeros((rest, 0))), posinf=0.0, neginf=0.0)


def ring_mm_per_px(points: ImagePoints) -> Float:
    """Return by how much (M,) the radius grows with the ring's outward shift in the image, mm/px."""
    assert points.per_px_c is not None
    return np.asarray(np.sum(points.normal_c * points.per_px_c, axis=1))


def _on_bore(run: GaugeRun, state: Unknowns) -> BoreRings:
    """Return the ring bins at the places predicted by the state without any effect.

    Derivatives at the measured places would share their noise, and bias the scores.
    """
    rings = run.rings
    for _ in range(_ROUNDS):
        rings = replace(rings, uv=expected_ring(state, rings)[1])
    return rings


def _without_edge_shift(
    run: GaugeRun, state: Unknowns, moving: Moving, terms: Sequence[Term]
) -> tuple[Edges, ImagePoints]:
    points = edge_points(state, run.edges, run.time_s, moving)
    # At the predicted places, for the same reason as rings.
    points = replace(points, uv=points.projected_uv)
    uv = run.edges.uv
    for t in terms:
        uv = uv - texture_shift_px(t.model, points, *t.at(t.amplitude))
    return replace(run.edges, uv=uv), points


def _ring_part(
    run: GaugeRun, state: Unknowns, rings: BoreRings, points: ImagePoints, residual: Float,
    terms: Sequence[Term],
) -> Equations:  # fmt: skip
    shift = [_slope(t, lambda model, *at: ring_shift_px(model, points, *at)) for t in terms]
    rows, _ = ring_rows(_without_edges(state), rings, residual, points.uv)
    return _with_effects(
        _in_px(rows, ring_mm_per_px(points)), -1.0, shift, run.ring_weight, wall_cells(rings.wall_mm), RING,
        rings.wall_mm,
    )  # fmt: skip


def _in_px(rows: Rows, mm_per_px: Float) -> Rows:
    """Return the equations (M,) of rings in pixels, without weight where the sheet is not seen."""
    seen = np.isfinite(mm_per_px) & (mm_per_px > 0)
    per_mm = np.divide(1.0, mm_per_px, out=np.zeros_like(mm_per_px), where=seen)
    return replace(
        rows,
        by_frame=per_mm[:, None, None] * rows.by_frame,
        by_border=per_mm[:, None] * rows.by_border,
        residual=per_mm * rows.residual,
        sigma=np.where(seen, rows.sigma, np.inf),
    )


def _without_edges(state: Unknowns) -> Unknowns:
    """Return a state with only those globals that rings and encoder depend on."""
    return replace(state, edge_mm=np.zeros((0, 4)))


def _edge_part(
    run: GaugeRun, state: Unknowns, edges: Edges, points: ImagePoints, terms: Sequence[Term]
) -> Equations:
    def texture_shift(model: EffectModel, shape: Shape, amplitude: Float) -> Float:
        return _across(texture_shift_px(model, points, shape, amplitude), edges)

    shift = [_slope(t, texture_shift) for t in terms]
    # Cell numbers of fiducials, one per edge, continue after those of the wall.
    number, at = 4 * edges.marker + edges.side, state.layout.marker
    rows = edge_rows(state, edges)
    by_edge = rows.by_border[np.arange(len(number)), at.start + number]
    rows = replace(rows, by_border=np.delete(rows.by_border, at, axis=1))
    nowhere = np.full((len(number), 2), np.nan)
    found = _with_effects(rows, 1.0, shift, run.edge_weight, -1 - number, EDGE, nowhere)
    return replace(found, edge=at.start + number, by_edge=by_edge)


def _with_effects(
    rows: Rows, sign: float, shift: list[Float], weight: Float, cell: Int, kind: int, wall_mm: Float
) -> Equations:
    effects = [sign * s for s in shift]
    bad = (
        ~np.all([np.isfinite(e).all(1) for e in effects], axis=0) if effects else np.zeros(len(weight), bool)
    )
    by_global = np.concatenate([rows.by_border, *effects], 1)
    by_global[bad] = 0.0
    usable = (rows.weight > 0) & np.isfinite(weight) & ~bad
    return Equations(
        rows.frame[:, 0], rows.by_frame[:, 0, :POSE], by_global, rows.residual,
        np.where(usable, weight, 0.0), cell, np.full(len(cell), kind), wall_mm, *of_no_edge(len(cell)),
    )  # fmt: skip


def _slope(term: Term, shift_of: Callable[[EffectModel, Shape, Float], Float]) -> Float:
    """Return the derivatives (M, Q) of a shift by the term's amplitudes, at their present values."""

    def shift(amplitude: Float) -> Float:
        return shift_of(term.model, *term.at(amplitude))

    out = []
    for k, amplitude in enumerate(term.amplitudes):
        step = np.zeros(len(term.amplitude))
        step[k] = 0.05 * amplitude.plausible
        out.append((shift(term.amplitude + step) - shift(term.amplitude - step)) / (2 * step[k]))
    return np.stack(out, -1)


def _encoder_part(
    run: GaugeRun, encoder: Encoder, state: Unknowns, travel: Travel, terms: Sequence[Term]
) -> Equations:
    count = len(run.time_s)
    scale, offset, delay = state.encoder
    reading = np.interp(run.time_s - delay, encoder.time_s, encoder.distance_mm)
    for t in terms:
        reading = reading - t.model.reading_shift_mm(travel, *t.at(t.amplitude))
    by_pose = np.zeros((count, POSE))
    by_pose[:, 2] = 1
    by_border = np.zeros((count, _without_edges(state).border_size))
    by_border[:, :ENCODER] = np.stack([-reading, -np.ones(count), travel.speed_mm_s], -1)
    shift = [_slope(t, lambda model, *at: model.reading_shift_mm(travel, *at)) for t in terms]
    by_global = np.concatenate([by_border, *[scale * s for s in shift]], 1)
    cell = -10_000_000 - np.arange(count) // _ENCODER_CELL
    # The weight is small: the encoder is examined separately, and a slip must not affect the poses.
    weight = np.full(count, _ENCODER_SIGMA_MM**-2)
    residual = state.T_pc[:, 2, 3] - scale * reading - offset
    kind = np.full(count, ENCODER_ROW)
    return Equations(
        np.arange(count), by_pose, by_global, residual, weight, cell, kind, np.full((count, 2), np.nan),
        *of_no_edge(count),
    )  # fmt: skip
