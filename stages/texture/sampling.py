"""Samples wall cells in lit frames, as data for the photometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Image, Int
from pipeline.geometry.image_places import ImagePlaces, clear_of
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from stages.texture.light import LEAST_LIGHT, irradiance
from stages.texture.surface import WallSurface
from stages.texture.views import LitViews, sheet_distance_mm

# Cells of wall around the pipe, and their length along it in radii.
_CELL_COLUMNS = 30
_CELL_RADII = 0.05
# Pictures are averaged over so many pixels each way before they are sampled.
_SHRINK = 8
# Grey levels that are used: darker ones are noise, brighter ones may be clipped. Debt: data/debts.md.
_DARK, _BRIGHT = 3.0, 245.0


@dataclass(frozen=True)
class LightSamples:
    """Brightness of wall cells in frames, flat arrays (N,).

    Attributes
    ----------
    log_ratio
        log of grey level over irradiance.
    theta_rad, azimuth_rad
        Place in the image.
    cell, view
        Indices of the wall cell and of the view.
    """

    log_ratio: Float
    theta_rad: Float
    azimuth_rad: Float
    cell: Int
    view: Int

    @staticmethod
    def none() -> LightSamples:
        """Return no samples."""
        number, whole = np.zeros(0), np.zeros(0, np.int64)
        return LightSamples(number, number, number, whole, whole)


class LightSampler:
    """Takes samples of the wall cells from frames."""

    def __init__(
        self,
        surface: WallSurface,
        probe: Probe,
        views: LitViews,
        reach_mm: float,
        laser_band_mm: float,
        left_out: ImagePlaces = (),
    ) -> None:
        self._probe, self._views = probe, views
        self._reach, self._band, self._left_out = reach_mm, laser_band_mm, left_out
        radius = surface.mean_radius_mm
        first, last = surface.seen_mm
        self._cell_mm = _CELL_RADII * radius
        self._radius = radius
        self._distance = np.arange(first, last, self._cell_mm)
        azimuth = np.linspace(-np.pi, np.pi, _CELL_COLUMNS, endpoint=False)
        self._patch = surface.patch(self._distance, azimuth)
        self._reference = float(self._at_sheet(radius))

    def of(self, seen: tuple[int, Image | None]) -> LightSamples:
        """Return the samples of ``seen``, a view and its luma (H, W); none without luma or wall."""
        view, image = seen
        rows = self._rows_near(view)
        if image is None or rows.start == rows.stop:
            return LightSamples.none()
        T_cp = self._views.T_cp[view]
        xyz_c = transform(T_cp, self._patch.xyz_p[rows])
        normal_c = self._patch.normal_p[rows] @ T_cp[:3, :3].T
        size = (image.shape[1] // _SHRINK, image.shape[0] // _SHRINK)
        small = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        scale = np.array(size) / np.array([image.shape[1], image.shape[0]])
        seen_at = self._probe.camera.project(xyz_c).uv
        uv = ((seen_at + 0.5) * scale - 0.5).astype(np.float32)
        grey = cv2.remap(small, uv[..., 0], uv[..., 1], cv2.INTER_LINEAR)
        light = irradiance(self._probe.lighting, xyz_c, normal_c) / self._reference
        use = self._usable(view, xyz_c) & (grey > _DARK) & (grey < _BRIGHT) & (light > LEAST_LIGHT)
        use &= clear_of(self._left_out, seen_at)
        cell = np.arange(rows.start * _CELL_COLUMNS, rows.stop * _CELL_COLUMNS).reshape(grey.shape)
        theta = np.arctan2(np.hypot(xyz_c[..., 0], xyz_c[..., 1]), xyz_c[..., 2])
        azimuth = np.arctan2(xyz_c[..., 1], xyz_c[..., 0])
        ratio = np.log(grey[use] / light[use])
        return LightSamples(ratio, theta[use], azimuth[use], cell[use], np.full(ratio.shape, view))

    @property
    def reference(self) -> float:
        """Irradiance at the laser ring of a centred probe."""
        return self._reference

    def _rows_near(self, view: int) -> slice:
        middle = self._views.distance_mm[view] + self._probe.laser.baseline_mm
        reach = self._reach + self._views.lean[view] * self._radius + self._cell_mm
        start, stop = np.searchsorted(self._distance, [middle - reach, middle + reach])
        return slice(int(start), int(stop))

    def _usable(self, view: int, xyz_c: Float) -> Bool:
        from_sheet = np.abs(sheet_distance_mm(self._probe.laser, xyz_c))
        near = from_sheet < self._reach
        return near & (from_sheet > 2 * self._band) if self._views.laser_on[view] else near

    def _at_sheet(self, radius: float) -> Float:
        point = np.array([radius, 0.0, self._probe.laser.baseline_mm])
        return irradiance(self._probe.lighting, point, np.array([-1.0, 0.0, 0.0]))


def joined(parts: Sequence[LightSamples], views: Int) -> LightSamples:
    """Return the samples of several views; ``view`` becomes the index in the ascending ``views`` (W,)."""
    if not parts:
        return LightSamples.none()
    samples = LightSamples(
        *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(LightSamples))
    )
    return replace(samples, view=np.searchsorted(views, samples.view))
