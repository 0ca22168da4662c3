"""The wall in front of a camera, unrolled about the local pipe axis and freed of its illumination.

A strip has rows of constant distance (``row`` 0 is distance 0 of the straightened pipe, spacing
``grid.step_mm``) and columns of constant azimuth (column 0 is −π). Where the texture lies in a strip hardly
depends on the camera's pose, so patches can be compared over many frames without warping.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Bool, Float, Float32, Image
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.probe import Probe
from stages.rings.kernels import FAST
from stages.texture.light import irradiance

_COARSE = 4
_BLUR_PX = 1.2
_SMOOTH_PX = 0.7
_IMAGE_BLUR_PX = 1.5  # lens, pixel and the blur above
_BLURS = 4
_LEAST_LIGHT = 0.05
_COURSE_PX = 3.0
_DARKEST, _BRIGHTEST = 5.0, 250.0


@dataclass(frozen=True)
class StripGrid:
    """Sampling of the straightened pipe wall.

    Attributes
    ----------
    radius_mm : float
        Of the cylinder on which the strip lies.
    columns : int
        Samples around.
    near_mm, far_mm : float
        Wall ahead of the camera that is sampled.
    """

    radius_mm: float
    columns: int
    near_mm: float
    far_mm: float

    @property
    def step_mm(self) -> float:
        """Row spacing, equal to the column spacing along the wall."""
        return 2 * np.pi * self.radius_mm / self.columns

    @property
    def rows(self) -> int:
        """Number of rows, a multiple of the coarse grid's step."""
        return int((self.far_mm - self.near_mm) / self.step_mm) // _COARSE * _COARSE

    def wall(self, row: Float, column: Float) -> Float:
        """Return points (..., 3) of strip positions (...) on the cylinder about the z-axis."""
        psi = column * (2 * np.pi / self.columns) - np.pi
        r = self.radius_mm
        return np.stack(np.broadcast_arrays(r * np.cos(psi), r * np.sin(psi), row * self.step_mm), -1)

    def position(self, xyz: Float) -> tuple[Float, Float]:
        """Return strip row and column (...) of points (..., 3)."""
        psi = np.arctan2(xyz[..., 1], xyz[..., 0])
        return xyz[..., 2] / self.step_mm, (psi + np.pi) * (self.columns / (2 * np.pi))


@dataclass(frozen=True)
class Strip:
    """One frame's view of the wall.

    Attributes
    ----------
    first_row : int
        Row of the pipe that is row 0 of the arrays.
    contrast : (H, W) float32
        Grey value over its neighbourhood's mean, minus 1; 0 where unusable.
    usable : (H, W) bool
    coarse_uv : (H/4 + 1, W/4 + 1, 2) float32
        Pixels of every fourth row and column.
    noise : (H,) float32
        1 σ of ``contrast`` from one sample to the next, in each row.
    """

    first_row: int
    contrast: Float32
    usable: Bool
    coarse_uv: Float32
    noise: Float32

    def pixel(self, row: Float, column: Float) -> Float:
        """Return (..., 2) pixels of strip positions: exactly where `unroll` sampled the image."""
        i, j = (row - self.first_row) / _COARSE, np.mod(column / _COARSE, self.coarse_uv.shape[1] - 1)
        m = np.clip(np.floor(i).astype(int), 0, self.coarse_uv.shape[0] - 2)
        n = np.clip(np.floor(j).astype(int), 0, self.coarse_uv.shape[1] - 2)
        a, b = (i - m)[..., None], (j - n)[..., None]
        g = self.coarse_uv.astype(np.float64)
        top = g[m, n] * (1 - b) + g[m, n + 1] * b
        low = g[m + 1, n] * (1 - b) + g[m + 1, n + 1] * b
        return np.asarray(top * (1 - a) + low * a)


def softened(image: Image) -> Image:
    """Return a grey image (H, W) without noise finer than a strip sample, which would fold into it."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), _BLUR_PX), np.uint8)


def unroll(
    image: Image, probe: Probe, T_pc: Float, grid: StripGrid, blocked_mm: tuple[float, float]
) -> Strip:
    """Unroll a `softened` grey image (H, W) as seen from pose ``T_pc`` (4, 4) in the straightened pipe.

    ``blocked_mm`` is the range of wall ahead of the camera hidden under the laser line; empty if equal.
    """
    first_row = int(np.ceil((T_pc[2, 3] + grid.near_mm) / grid.step_mm))
    coarse_uv, light = _coarse_view(probe, T_pc, grid, first_row)
    grey, seen = _sample(image, coarse_uv, _COARSE)
    ahead = (first_row + np.arange(grid.rows)) * grid.step_mm - T_pc[2, 3]
    seen[(ahead > blocked_mm[0]) & (ahead < blocked_mm[1])] = False
    usable = seen & (grey < _BRIGHTEST) & (grey > _DARKEST)
    contrast = _equally_sharp(_without_light(grey / _refined(light, _COARSE), usable), coarse_uv)
    return Strip(first_row, contrast, usable, coarse_uv, _noise_of(contrast, usable))


def _without_light(grey: Float32, usable: Bool) -> Float32:
    """Return grey over the light that fell there, minus 1; 0 where unusable.

    A slope of the light within a patch shifts its match by half the slope times the squared length of the
    texture, always the same way. Divided out are the light predicted and the course along the pipe, the same
    all round, of what that leaves. A local mean would follow the light too, but at borders, where it sees one
    side only, it shifts the texture.
    """
    course, count = _row_means(grey, usable)
    row = np.arange(len(course))
    known = count > 0.1 * grey.shape[1]
    if not known.any():
        return np.zeros_like(grey)
    course = gaussian_filter1d(np.interp(row, row[known], course[known]), _COURSE_PX)
    return np.asarray(_over(grey, usable, np.maximum(course, 1.0).astype(np.float32)))


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _row_means(grey, usable):  # type: ignore[no-untyped-def]
    """Return each row's mean (H,) of the usable samples, and how many there are."""
    mean, count = np.zeros(len(grey)), np.zeros(len(grey), np.int64)
    for i in range(grey.shape[0]):
        total, many = np.float32(0), 0
        for j in range(grey.shape[1]):
            total += grey[i, j] if usable[i, j] else np.float32(0)
            many += usable[i, j]
        mean[i], count[i] = total / max(many, 1), many
    return mean, count


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _over(grey, usable, course):  # type: ignore[no-untyped-def]
    """Return grey over each row's ``course`` (H,), minus 1; 0 where unusable."""
    out = np.empty_like(grey)
    for i in range(grey.shape[0]):
        for j in range(grey.shape[1]):
            out[i, j] = grey[i, j] / course[i] - np.float32(1) if usable[i, j] else np.float32(0)
    return out


def _equally_sharp(contrast: Float32, coarse_uv: Float32) -> Float32:
    """Smooth each row so that the near wall is as blurred as the far one.

    Contrast that falls off across a patch shifts its match just as light does, and the image's blur is larger
    on the wall far ahead. Blurs of some sizes are mixed by variance.
    """
    along, around = (_blur_of(coarse_uv, axis) for axis in (0, 1))
    wanted = np.sqrt(np.stack([along.max() - along, around.max() - around], -1) + _SMOOTH_PX**2)
    share = np.linspace(0, 1, _BLURS)
    sizes = wanted.min(0) + share[:, None] * (wanted.max(0) - wanted.min(0))
    level = (_BLURS - 1) * np.clip((wanted[:, 0] - sizes[0, 0]) / max(np.ptp(sizes[:, 0]), 1e-6), 0, 1)
    out = np.zeros_like(contrast)
    for k, (sigma_along, sigma_around) in enumerate(sizes):
        weight = np.maximum(1 - np.abs(level - k), 0).astype(np.float32)[:, None]
        rows = np.flatnonzero(weight)
        if rows.size:
            part = slice(rows[0], rows[-1] + 1)
            out[part] += weight[part] * _blurred(contrast, part, sigma_along, sigma_around)
    return out


def _blurred(contrast: Float32, part: slice, sigma_along: float, sigma_around: float) -> Float32:
    """Return some rows of the blurred strip, blurred with just as many more as the blur reaches."""
    more = int(np.ceil(5 * sigma_along)) + 1
    first = max(part.start - more, 0)
    wide = cv2.GaussianBlur(contrast[first : part.stop + more], (0, 0), sigma_around, None, sigma_along)
    return np.asarray(wide[part.start - first : part.stop - first])


def _blur_of(coarse_uv: Float32, axis: int) -> Float:
    """Return the image blur's variance (H,), strip px², along rows (axis 0) or columns (1)."""
    step = np.linalg.norm(np.diff(coarse_uv.astype(np.float64), axis=axis), axis=-1) / _COARSE
    # A median of numbers alone takes a tenth of the time of one that minds NaN.
    per_px = np.median(np.nan_to_num(step, nan=1.0), axis=1)
    variance = (_IMAGE_BLUR_PX / np.maximum(per_px, 1e-3)) ** 2
    rows = (np.arange((coarse_uv.shape[0] - 1) * _COARSE) + 0.5) / _COARSE
    return np.asarray(np.interp(rows, np.arange(len(variance)) + (0.5 if axis == 0 else 0.0), variance))


def _coarse_view(probe: Probe, T_pc: Float, grid: StripGrid, first_row: int) -> tuple[Float32, Float32]:
    """Return pixels (H/4 + 1, W/4 + 1, 2) of every fourth row and column, and the light that falls there.

    The LEDs' light is predicted, up to a factor: off the axis it is uneven around the wall.
    """
    rows = first_row + _COARSE * np.arange(grid.rows // _COARSE + 1.0)
    xyz = grid.wall(rows[:, None], _COARSE * np.arange(grid.columns // _COARSE + 1.0))
    T_cp = inverse(T_pc)
    xyz_c = transform(T_cp, xyz)
    normal_c = (xyz * [-1 / grid.radius_mm, -1 / grid.radius_mm, 0.0]) @ T_cp[:3, :3].T
    light = irradiance(probe.lighting, xyz_c, normal_c)
    light = np.maximum(light, _LEAST_LIGHT * light.max(initial=1e-12)) / light.mean()
    return probe.camera.project(xyz_c).uv.astype(np.float32), light.astype(np.float32)


def _noise_of(contrast: Float32, usable: Bool) -> Float32:
    """Return each row's noise (H,), 1 σ, from second differences around, which texture hardly reaches."""
    power, share = _second_differences(contrast, usable)
    known = gaussian_filter1d(share, 2 * _COURSE_PX)
    return np.sqrt(gaussian_filter1d(power, 2 * _COURSE_PX) / np.maximum(known, 1e-3)).astype(np.float32)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _second_differences(contrast, usable):  # type: ignore[no-untyped-def]
    """Return each row's mean (H,) of a sixth of their squares, and the share that is usable."""
    rows, columns = contrast.shape
    power, share = np.zeros(rows), np.zeros(rows)
    for i in range(rows):
        total, count = np.float32(0), 0
        for j in range(columns - 4):
            d = contrast[i, j + 4] - np.float32(2) * contrast[i, j + 2] + contrast[i, j]
            ok = usable[i, j + 4] and usable[i, j + 2] and usable[i, j]
            total += d * d if ok else np.float32(0)
            count += ok
        power[i], share[i] = total / max(count, 1) / 6, count / (columns - 4)
    return power, share


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _refine(coarse, row, step, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (W,) with a row of the bilinear refinement of values (H / step + 1, W / step + 1)."""
    m, a = row // step, np.float32((row % step) / step)
    before = coarse[m, 0] + a * (coarse[m + 1, 0] - coarse[m, 0])
    for n in range(1, coarse.shape[1]):
        after = coarse[m, n] + a * (coarse[m + 1, n] - coarse[m, n])
        slope = (after - before) / np.float32(step)
        for k in range(step):
            out[(n - 1) * step + k] = before + np.float32(k) * slope
        before = after


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _refined(coarse, step):  # type: ignore[no-untyped-def]
    """Return the bilinear refinement (H, W) of values at every so many rows and columns."""
    out = np.empty(((coarse.shape[0] - 1) * step, (coarse.shape[1] - 1) * step), np.float32)
    for row in range(out.shape[0]):
        _refine(coarse, row, step, out[row])
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sample(image, coarse, step):  # type: ignore[no-untyped-def]
    """Bilinear look-up of the image on the coarse pixel grid refined ``step`` times."""
    rows, columns = (coarse.shape[0] - 1) * step, (coarse.shape[1] - 1) * step
    grey = np.zeros((rows, columns), np.float32)
    seen = np.zeros((rows, columns), np.bool_)
    u, v = np.empty(columns, np.float32), np.empty(columns, np.float32)
    height, width = image.shape
    flat = image.ravel()
    for i in range(rows):
        _refine(coarse[:, :, 0], i, step, u)
        _refine(coarse[:, :, 1], i, step, v)
        for j in range(columns):
            if not (0 <= u[j] < width - 1 and 0 <= v[j] < height - 1):
                continue
            x, y = np.int64(u[j]), np.int64(v[j])
            p, q = u[j] - np.float32(x), v[j] - np.float32(y)
            at = np.uintp(y * width + x)
            below = at + np.uintp(width)
            left, right = np.float32(flat[at]), np.float32(flat[at + np.uintp(1)])
            top = left + p * (right - left)
            left, right = np.float32(flat[below]), np.float32(flat[below + np.uintp(1)])
            grey[i, j] = top + q * (left + p * (right - left) - top)
            seen[i, j] = True
    return grey, seen
