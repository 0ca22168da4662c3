"""A long pipe photographed stretch by stretch: each has its own light, joined to the next by shared views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.instrument.probe import Probe
from stages.texture.light import LightField
from stages.texture.photometry import Light, solve_light
from stages.texture.sampling import LightSamples
from stages.texture.views import TileViews

_ANGLES = 32


@dataclass(frozen=True)
class TextureStretch:
    """Tiles that follow each other, and the views (W,) that they want, ascending."""

    tiles: range
    wanted: Int


def cut_plan(plan: Sequence[TileViews], views_at_once: int) -> list[TextureStretch]:
    """Return stretches of tiles that want about so many views; a short pipe is one."""
    stretches: list[TextureStretch] = []
    first, wanted = 0, np.zeros(0, np.int64)
    for tile, chosen in enumerate(plan):
        both = np.union1d(wanted, chosen.views)
        if len(both) > views_at_once and tile > first:
            stretches.append(TextureStretch(range(first, tile), wanted))
            first, both = tile, np.unique(chosen.views)
        wanted = both
    return [*stretches, TextureStretch(range(first, len(plan)), wanted)]


class LightChain:
    """The lights of stretches, each as bright as the one before it in the views that both want.

    The first is as bright as recorded where the median view sees the laser ring, at ``ring_polar_rad``.

    Attributes
    ----------
    gain : (V,)
        Exposure of every view, as found in the last stretch that wants it; NaN where there is none.
    wanted : (W,) int
        Views of all stretches so far.
    """

    def __init__(self, views: int, probe: Probe, ring_polar_rad: float) -> None:
        self._probe, self._ring_polar_rad = probe, ring_polar_rad
        self._before: Light | None = None
        self._residuals: list[float] = []
        self.gain: Float = np.full(views, np.nan)
        self.wanted: Int = np.zeros(0, np.int64)

    def add(self, samples: LightSamples, wanted: Int, reference: float) -> Light:
        """Return the light of a stretch, with the exposures of all views (V,); NaN beyond the stretch."""
        found = solve_light(samples, len(wanted), self._probe, reference)
        gain = np.full(len(self.gain), np.nan)
        gain[wanted] = found.gain
        light = replace(found, gain=gain)
        if self._before is None:
            light = _one_at(light, self._ring_polar_rad)
        else:
            light = replace(light, gain=gain * _ratio(self._before, light))
        self._before = light
        self._residuals.append(light.residual)
        self.gain[wanted] = light.gain[wanted]
        self.wanted = np.union1d(self.wanted, wanted)
        return light

    @property
    def residual(self) -> float:
        """Robust 1 σ of relative brightness after the fit, median over the stretches."""
        return float(np.median(self._residuals))


def _one_at(light: Light, polar_rad: float) -> Light:
    """Return the light with a brightness of 1 at a polar angle in the median view.

    Wall, light and exposures are known up to common factors, which are chosen so that the wall's photo is as
    bright as recorded.
    """
    if not np.isfinite(light.gain).any():
        return light
    level = float(_course(light.field, np.array([polar_rad]))[0])
    field = replace(light.field, log_correction=light.field.log_correction - level)
    return replace(light, field=field, gain=light.gain / np.nanmedian(light.gain))


def _ratio(before: Light, light: Light) -> float:
    """Return by how much the shared views are brighter in the light before; 1 where none is shared."""
    shared = np.isfinite(before.gain) & np.isfinite(light.gain)
    if not shared.any():
        return 1.0
    exposure = np.median(np.log(before.gain[shared]) - np.log(light.gain[shared]))
    ends = [(f.theta_from, f.theta_from + f.theta_step * (len(f.log_correction) - 1))
            for f in (before.field, light.field)]  # fmt: skip
    theta = np.linspace(max(e[0] for e in ends), min(e[1] for e in ends), _ANGLES)
    return float(np.exp(exposure + np.mean(_course(before.field, theta) - _course(light.field, theta))))


def _course(field: LightField, theta: Float) -> Float:
    """Return the correction's mean around the image at polar angles."""
    at = field.theta_from + field.theta_step * np.arange(len(field.log_correction))
    return np.asarray(np.interp(theta, at, field.log_correction.mean(1)))
