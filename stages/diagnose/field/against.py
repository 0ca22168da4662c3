"""Rings of a field recording against where its texture alone has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.field.points import ring_points
from stages.diagnose.field.reduce import reduced, rings_after
from stages.diagnose.field.run import FieldRun
from stages.diagnose.field.system import field_system

Float = NDArray[np.float64]
Int = NDArray[np.int64]
# Rings count so little less that poses and wall are those of the texture.
_RELAXED = 1e3


@dataclass(frozen=True)
class RingsAgainstTexture:
    """By how much ring bins lie farther out than texture, poses and a smooth pipe have them.

    Attributes
    ----------
    frame : (M,) int
        Places in the frame table.
    azimuth_c_rad, azimuth_p_rad, distance_mm : (M,)
        Azimuth in C, azimuth and distance of the wall point in P.
    residual_mm, residual_px : (M,)
        As radius, and as outward shift in the image.
    uv : (M, 2)
    usable : (M,) bool
        False where the adjustment found an outlier.
    """

    frame: Int
    azimuth_c_rad: Float
    azimuth_p_rad: Float
    distance_mm: Float
    residual_mm: Float
    residual_px: Float
    uv: Float
    usable: NDArray[np.bool_]

    @property
    def rms_px(self) -> float:
        """R.m.s. of what is usable, px."""
        return float(np.sqrt(np.mean(self.residual_px[self.usable] ** 2)))


def rings_against_texture(
    run: FieldRun, terms: Sequence[tuple[EffectModel, Shape, Float]] = ()
) -> RingsAgainstTexture:
    """Return the rings' residual with the probe as stated and poses by texture.

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
    found = reduced(relaxed, len(run.state.T_pc))
    # From the instrument as this run would bend it back to the stated one.
    to = -system.value
    if terms:
        amplitude = np.concatenate([a for _, _, a in terms])
        to[len(to) - len(amplitude) :] = amplitude
    residual = rings_after(rings, found, to)
    points = ring_points(run)
    assert points.distance_mm is not None
    by_pixel = run.probe.triangulate_jacobian(points.uv)[0]
    mm_per_px = np.einsum("mi,mij,mj->m", points.normal_c, by_pixel, points.outward)
    weight = run.equations.rings.weight
    return RingsAgainstTexture(
        run.measured.rings.frame, points.azimuth_rad, points.azimuth_p_rad, points.distance_mm,
        residual, residual / mm_per_px, points.uv, np.asarray(weight > 0.1 * np.median(weight)),
    )  # fmt: skip
