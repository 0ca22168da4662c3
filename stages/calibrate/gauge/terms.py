"""The equations of the gauge adjustment: edges of fiducials, rings on known bore, encoder, priors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.motion_priors import slip_drift_rows
from pipeline.adjustment.robust import Cauchy, robust_spread
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import inverse, skew, transform
from pipeline.recording.base import Encoder
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.geometry import BoreRings
from stages.calibrate.gauge.state import ENCODER, OFFSET_SIGMA_MM, GaugeParameters, Unknowns

# Half the span over which the encoder's speed is differenced, and 1 σ with which the first frame's slip is
# held at 0: half and twice of them move no parameter of drawn gauge runs by 1e-9 of its σ.
_STEP_S, _ORIGIN_SIGMA_MM = 1e-3, 1e-3
# A ring farther than this from its expected place is an outlier, and its derivatives have no influence.
_FARTHEST_PX = 3.0
# Half the step of a derivative along the image radius, px: its error is of the third order, below 1e-6.
_APART = 0.1
# Side of the cells of wall in which errors are assumed equal. Debt: data/debts.md.
WALL_CELL_MM = 10.0


@dataclass(frozen=True)
class Equations:
    """Linearised measurements: ``rows``, residuals in σ, and the cell of wall of each (cluster)."""

    rows: Rows
    in_sigma: Float
    cluster: Int


def edge_equations(state: Unknowns, edges: Edges) -> Equations:
    """Return the equations of borders: each is projected to its measured place, up to a shift of its edge."""
    return _weighted(edge_rows(state, edges), edges.sigma_px, 4 * edges.marker + edges.side)


def edge_rows(state: Unknowns, edges: Edges) -> Rows:
    """Return the equations of borders without weights: σ is 1, infinite where they are not defined."""
    T = state.T_pc[edges.frame]
    xyz_p = edges.xyz_p + state.edge_mm[edges.marker, edges.side][:, None] * edges.outward_p
    xyz_c = transform(inverse(T), xyz_p)
    camera = state.probe.camera
    by_c, by_camera = camera.project_jacobian(xyz_c)
    residual = np.einsum("mi,mi->m", camera.project(xyz_c).uv - edges.uv, edges.normal)
    across_c = np.einsum("mi,mij->mj", edges.normal, by_c)
    across_p = np.einsum("mj,mij->mi", across_c, T[:, :3, :3])
    by_frame = np.zeros((len(residual), 1, BLOCK))
    by_frame[:, 0, :3] = -across_p
    by_frame[:, 0, 3:6] = np.einsum("mj,mjk->mk", across_c, skew(xyz_c))
    at, m, edge = state.layout, np.arange(len(residual)), 4 * edges.marker + edges.side
    by_border = np.zeros((len(residual), at.size))
    by_border[m, at.marker.start + edge] = np.einsum("mi,mi->m", across_p, edges.outward_p)
    by_border[:, at.instrument] = (
        np.einsum("mi,mij->mj", edges.normal, by_camera) @ state.unsure[: by_camera.shape[2]]
    )
    return _usable(edges.frame, by_frame, by_border, residual)


def ring_equations(state: Unknowns, rings: BoreRings) -> Equations:
    """Return the equations: each triangulated ring point lies on the bore of its section.

    Derivatives are taken at the expected, not at the measured place of the ring: there they contain the
    measurement's own noise, and its product with the residual has a mean, which biases baseline and cone
    (W. A. Fuller, "Measurement Error Models", 1987, ch. 3).
    """
    residual, uv = expected_ring(state, rings)
    rows, mm_per_px = ring_rows(state, rings, residual, uv)
    return _weighted(rows, rings.sigma_px * mm_per_px, wall_cells(rings.wall_mm))


def ring_rows(state: Unknowns, rings: BoreRings, residual: Float, uv: Float) -> tuple[Rows, Float]:
    """Return the equations of rings, linearised at ``uv`` (M, 2), without weights, and (M,) mm per px.

    σ is 1, infinite where they are not defined.
    """
    T = state.T_pc[rings.frame]
    xyz_c, normal, _ = _wall_at(state, T, uv)
    by_pixel, by_parameters = state.probe.triangulate_jacobian(uv)
    normal_c = np.einsum("mi,mij->mj", normal, T[:, :3, :3])
    by_frame = np.zeros((len(residual), 1, BLOCK))
    by_frame[:, 0, :3] = normal
    by_frame[:, 0, 3:6] = -np.einsum("mj,mjk->mk", normal_c, skew(xyz_c))
    at = state.layout
    by_border = np.zeros((len(residual), at.size))
    by_border[np.arange(len(residual)), at.bore.start + rings.section] = -1
    by_border[:, at.instrument] = np.einsum("mj,mjp->mp", normal_c, by_parameters) @ state.unsure
    mm_per_px = np.abs(np.einsum("mj,mjk,mk->m", normal_c, by_pixel, rings.outward))
    return _usable(rings.frame, by_frame, by_border, residual), mm_per_px


def expected_ring(state: Unknowns, rings: BoreRings) -> tuple[Float, Float]:
    """Return the distances (M,), mm, of ring points from the bore, and their expected pixels (M, 2)."""
    residual = ring_residual(state, rings, rings.uv)
    higher, lower = (ring_residual(state, rings, rings.uv + way * rings.outward) for way in (_APART, -_APART))
    away = np.clip(2 * _APART * residual / (higher - lower), -_FARTHEST_PX, _FARTHEST_PX)
    return residual, rings.uv - away[:, None] * rings.outward


def ring_residual(state: Unknowns, rings: BoreRings, uv: Float) -> Float:
    """Return the distances (M,), mm, from the bore of ring points seen at ``uv`` (M, 2)."""
    return np.asarray(_wall_at(state, state.T_pc[rings.frame], uv)[2] - _bore_radius(state, rings))


def _wall_at(state: Unknowns, T: Float, uv: Float) -> tuple[Float, Float, Float]:
    """Return wall points (M, 3) in C, directions (M, 3) in P away from the gauge's axis, and radii (M,)."""
    xyz_c = state.probe.triangulate(uv)
    xyz_p = transform(T, xyz_c)
    radius = np.hypot(xyz_p[:, 0], xyz_p[:, 1])
    return xyz_c, np.stack([xyz_p[:, 0] / radius, xyz_p[:, 1] / radius, 0 * radius], -1), radius


def wall_cells(wall_mm: Float) -> Int:
    """Return numbers (M,) of the square cells of wall in which points (M, 2) lie."""
    cell = np.floor(wall_mm / WALL_CELL_MM).astype(np.int64)
    return np.asarray(cell[:, 0] * 10_000 + cell[:, 1])


def encoder_equations(
    state: Unknowns, time_s: Float, encoder: Encoder, parameters: GaugeParameters
) -> tuple[Rows, Rows]:
    """Return the equations of the encoder's readings, and those that let its slip change only slowly.

    distance = scale × reading at (time − delay) + offset + slip.
    """
    count = len(time_s)
    scale, offset, delay = state.encoder
    at_time = time_s - delay
    reading = np.interp(at_time, encoder.time_s, encoder.distance_mm)
    speed = (
        np.interp(at_time + _STEP_S, encoder.time_s, encoder.distance_mm)
        - np.interp(at_time - _STEP_S, encoder.time_s, encoder.distance_mm)
    ) / (2 * _STEP_S)
    by_frame = np.zeros((count, 1, BLOCK))
    by_frame[:, 0, 2], by_frame[:, 0, 6] = 1, -1
    by_border = np.zeros((count, state.border_size))
    by_border[:, :ENCODER] = np.stack([-reading, -np.ones(count), scale * speed], -1)
    residual = state.T_pc[:, 2, 3] - scale * reading - offset - state.slip
    sigma = parameters.encoder_sigma_mm
    readings = Rows(np.arange(count)[:, None], by_frame, by_border, residual, np.full(count, sigma), Cauchy())
    drift = slip_drift_rows(state.slip, parameters.encoder_slip_sigma_mm, state.border_size)
    return readings, drift


def slip_origin(state: Unknowns, with_encoder: bool) -> Rows:
    """Return equations that start the slip at zero, and without an encoder keep it there."""
    frame = np.arange(1 if with_encoder else len(state.slip))
    by_frame = np.zeros((len(frame), 1, BLOCK))
    by_frame[:, 0, 6] = 1
    none = np.zeros((len(frame), state.border_size))
    return Rows(frame[:, None], by_frame, none, state.slip[frame], np.full(len(frame), _ORIGIN_SIGMA_MM))


def prior_rows(state: Unknowns, radius_sigma_mm: float, parameters: GaugeParameters) -> Rows:
    """Return the priors of the global unknowns."""
    at = state.layout
    value = np.concatenate(
        [
            state.encoder - [1.0, state.first_offset_mm, 0.0],
            state.bore_mm,
            state.edge_mm.ravel(),
            state.instrument,
        ]
    )
    sigma = np.ones(at.size)
    sigma[:ENCODER] = state.stated.encoder_scale_sigma, OFFSET_SIGMA_MM, parameters.delay_prior_s
    sigma[at.bore] = max(radius_sigma_mm, 1e-5)
    sigma[at.marker] = parameters.placement_sigma_mm
    none = np.zeros((at.size, 0), np.int64)
    return Rows(none, np.zeros((at.size, 0, BLOCK)), np.eye(at.size), value, sigma)


def _bore_radius(state: Unknowns, rings: BoreRings) -> Float:
    return np.asarray(rings.radius_mm + state.bore_mm[rings.section])


def _usable(frame: Int, by_frame: Float, by_border: Float, residual: Float) -> Rows:
    bad = ~(np.isfinite(residual) & np.isfinite(by_border).all(1) & np.isfinite(by_frame).all((1, 2)))
    for part in (residual, by_frame, by_border):
        part[bad] = 0.0
    return Rows(frame[:, None], by_frame, by_border, residual, np.where(bad, np.inf, 1.0))


def _weighted(rows: Rows, sigma: Float, cluster: Int) -> Equations:
    """Return equations with Cauchy weights; the σ of a frame's measurements is scaled by their spread."""
    known = np.isfinite(sigma)
    in_sigma = rows.residual / np.where(known, sigma, 1.0)
    spread = sigma * frame_spread(rows.frame[:, 0], in_sigma)
    believed = np.where(known & np.isfinite(rows.sigma), spread, np.inf)
    return Equations(replace(rows, sigma=believed, loss=Cauchy()), in_sigma, cluster)


def frame_spread(frame: Int, in_sigma: Float) -> Float:
    """Return the robust spread (M,) of each equation's frame, in σ, not below that of the typical frame."""
    numbers, place = np.unique(frame, return_inverse=True)
    spread = np.array([robust_spread(in_sigma[place == k]) for k in range(len(numbers))])
    typical = np.median(spread) if len(spread) else 1.0
    return np.asarray(np.maximum(np.maximum(spread, typical), 1e-3)[place])
