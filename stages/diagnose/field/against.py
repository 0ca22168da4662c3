"""Rings of a field recording against where its texture alone has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Illumination
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.predict import columns
from stages.diagnose.field.reduce import reduced, rings_after
from stages.diagnose.field.run import FieldRun, ring_points
from stages.diagnose.field.system import field_system
from stages.diagnose.residual import RingResidual

# Factor on the rings' σ, so large that texture alone determines poses and wall.
_RELAXED = 1e3
_OUTLIER = 0.1


def rings_against_texture(
    run: FieldRun, terms: Sequence[tuple[EffectModel, Shape, Float]] = ()
) -> RingResidual:
    """Return the rings' residual with the probe as stated and poses by texture.

    The pipe's radius is not known beforehand: the mean residual is taken out. Ring frames before the first
    lit frame and after the last have no pose by texture and do not count.

    Parameters
    ----------
    terms
        Effects, their shapes and amplitudes (Q,), whose shift is taken out to first order.

    Raises
    ------
    numpy.linalg.LinAlgError
        When texture alone does not determine the poses.
    """
    system = field_system(run, [(model, shape) for model, shape, _ in terms], np.zeros(0, np.int64))
    rings = system.rows[0]
    relaxed = replace(system, rows=(replace(rings, sigma=_RELAXED * rings.sigma), *system.rows[1:]))
    # From the instrument as this run would bend it back to the stated one.
    to = -system.value
    if terms:
        amplitude = np.concatenate([a for _, _, a in terms])
        to[len(to) - len(amplitude) :] = amplitude
    residual = rings_after(rings, reduced(relaxed, len(run.state.T_pc)), to)
    points = ring_points(run)
    assert points.distance_mm is not None
    by_pixel = run.probe.triangulate_jacobian(points.uv)[0]
    mm_per_px = np.einsum("mi,mij,mj->m", points.normal_c, by_pixel, points.outward)
    frame, weight = run.recording.frames.frame[run.measured.rings.frame], run.equations.rings.weight
    usable = (weight > _OUTLIER * np.median(weight)) & _between_lit(run, frame)
    residual = residual - np.mean(residual[usable])
    return RingResidual(
        "field", frame, points.azimuth_rad, points.azimuth_p_rad, points.distance_mm, points.uv,
        residual, residual / mm_per_px, usable,
    )  # fmt: skip


def floor_px(run: FieldRun, left: RingResidual, terms: Sequence[tuple[EffectModel, Shape, Float]]) -> float:
    """Return the r.m.s., px, that is left when the effects' sizes are fitted to these very rings."""
    points = ring_points(run)
    patterns = [columns(model, points, shape) for model, shape, _ in terms]
    design = np.concatenate([np.ones((len(left.frame), 1)), *patterns], 1)
    keep = left.usable & np.isfinite(design).all(1)
    found = np.linalg.lstsq(design[keep], left.residual_px[keep], rcond=None)[0]
    return float(np.sqrt(np.mean((left.residual_px[keep] - design[keep] @ found) ** 2)))


def _between_lit(run: FieldRun, frame: Int) -> Bool:
    lit = run.recording.frames.of(Illumination.LED, Illumination.BOTH)
    return np.asarray((frame >= lit[0]) & (frame <= lit[-1]))
