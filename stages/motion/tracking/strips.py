"""Unrolled strips: the wall in front of the camera as a picture over distance and azimuth.

A strip has rows of constant distance (row 0 is distance 0 of the straightened pipe, spacing
``grid.step_mm``) and columns of constant azimuth (column 0 is −π). The place of a spot of the wall in a strip
hardly depends on the camera's pose, so that patches can be compared over many frames without warping.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numba
import numpy as np

from pipeline.arrays import Bool, Byte, Float, Float32, Image, Int
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Illumination, Recording, in_background
from pipeline.system.parallel import side_by_side
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.tracking.normalisation import (
    SOFTENING_PX,
    equally_sharp,
    noise_of_rows,
    without_illumination,
)
from stages.premises.stays import darkest_channel, in_full
from stages.texture.light import irradiance

_COARSE = (8, 4)
"""The camera model is computed for every eighth row and fourth column, more densely around the pipe because
pixels lie on a curve there, and interpolated between. `Strip.pixel` uses the same interpolation, so that
positions have no error from it."""
_LEAST_LIGHT = 0.05
"""Predicted light below this share of the largest is not used: the division would amplify noise."""
_DARKEST, _BRIGHTEST = 5.0, 250.0
"""Grey values of 8 bits between which a sample is usable: beyond them, the sensor may clip. A wall that spans
no more than 5 is not lit: black may be 16; over the predicted light it was texture that stands still."""
_LINE_HALF_WIDTH_SIGMA = 12
"""Half width, in σ of the laser line, of the wall hidden under it: the line is below 1e-4 of its peak beyond
4.3 σ; its glow reaches farther, a gradient that `without_illumination` removes. Not measured."""
_DECODED_AHEAD = 4
NEVER = 1 << 62
"""Larger than the index of any picture."""


@dataclass(frozen=True)
class StripGrid:
    """Sampling of the straightened pipe wall.

    Attributes
    ----------
    radius_mm : float
        Radius of the cylinder on which the strip lies.
    columns : int
        Number of samples around, a multiple of 4.
    near_mm, far_mm : float
        Range of wall ahead of the camera that is sampled.
    bore : Bore
        Excess of the pipe's width over the cylinder. On a plain cylinder the texture of a reducer would be
        stretched more and more as the camera comes near, and its patches matched wrongly.
    """

    radius_mm: float
    columns: int
    near_mm: float
    far_mm: float
    bore: Bore = ONE_BORE

    @property
    def step_mm(self) -> float:
        """Row spacing, equal to the column spacing along the wall."""
        return 2 * np.pi * self.radius_mm / self.columns

    @property
    def length_mm(self) -> float:
        """Length of the wall that is sampled."""
        return self.far_mm - self.near_mm

    @property
    def rows(self) -> int:
        """Number of rows, a multiple of the coarse grid's step."""
        return int(self.length_mm / self.step_mm) // _COARSE[0] * _COARSE[0]

    def wall(self, row: Float, column: Float) -> Float:
        """Return points (..., 3) of strip positions (...) on the wall about the z-axis."""
        psi = column * (2 * np.pi / self.columns) - np.pi
        r = self.radius_mm + self.bore.wider_at(row * self.step_mm)
        return np.stack(np.broadcast_arrays(r * np.cos(psi), r * np.sin(psi), row * self.step_mm), -1)


@dataclass(frozen=True)
class Strip:
    """One frame's view of the wall.

    Attributes
    ----------
    first_row : int
        Row of the pipe that is row 0 of the arrays.
    contrast : (H, W) float32
        Grey value over the mean of its row, minus 1; 0 where unusable.
    usable : (H, W) bool
    coarse_uv : (H/8 + 1, W/4 + 1, 2) float32
        Pixels of every eighth row and fourth column.
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
        i = (row - self.first_row) / _COARSE[0]
        j = np.mod(column / _COARSE[1], self.coarse_uv.shape[1] - 1)
        m = np.clip(np.floor(i).astype(int), 0, self.coarse_uv.shape[0] - 2)
        n = np.clip(np.floor(j).astype(int), 0, self.coarse_uv.shape[1] - 2)
        a, b = (i - m)[..., None], (j - n)[..., None]
        g = self.coarse_uv
        top = g[m, n].astype(np.float64) * (1 - b) + g[m, n + 1] * b
        low = g[m + 1, n].astype(np.float64) * (1 - b) + g[m + 1, n + 1] * b
        return np.asarray(top * (1 - a) + low * a)

    def px_per_sample(self, at: Float) -> Float:
        """Return image px (N,) per strip sample at strip positions (N, 2), rms of both directions."""
        du = self.pixel(at[:, 0] + 1, at[:, 1]) - self.pixel(at[:, 0], at[:, 1])
        dv = self.pixel(at[:, 0], at[:, 1] + 1) - self.pixel(at[:, 0], at[:, 1])
        return np.asarray(np.sqrt((np.sum(du * du, 1) + np.sum(dv * dv, 1)) / 2))


@dataclass(frozen=True)
class Hidden:
    """Parts of a picture that hide the wall, or do not show it.

    Attributes
    ----------
    line_mm : (float, float)
        Range of wall ahead of the camera under the laser line; empty if equal.
    stays : (H, W) uint8 or None
        Above 0 where something stays in the picture while the wall moves.
    end_from : int
        Index, in the list of all frames, of the first picture in which the pipe may end behind the line.
    """

    line_mm: tuple[float, float] = (0.0, 0.0)
    stays: Byte | None = None
    end_from: int = NEVER

    def at(self, place: int) -> Hidden:
        """Return the parts for one picture, by its index in the list of all frames."""
        return self if place < self.end_from else replace(self, line_mm=(self.line_mm[0], np.inf))


@dataclass(frozen=True)
class WallView:
    """Unrolls the lit frames of a recording, without the parts that hide the wall."""

    recording: Recording
    probe: Probe
    grid: StripGrid
    end_from: int = NEVER

    @property
    def lit(self) -> Int:
        """Return the lit frames (K,) as indices in the list of all frames."""
        frames = self.recording.frames
        return self._place(frames.of(Illumination.LED, Illumination.BOTH))

    @property
    def hidden(self) -> Hidden:
        """Return the parts of the pictures that hide the wall."""
        half = _LINE_HALF_WIDTH_SIGMA * self.probe.laser.line_sigma_mm if self._both else 0.0
        at_mm = self.probe.laser.baseline_mm
        stays = in_full(self.recording.stays, self.recording.source.image_size)
        return Hidden((at_mm - half, at_mm + half), stays, self.end_from)

    def images(self, place: Int) -> Iterator[tuple[int, Image | None]]:
        """Yield indices and softened grey pictures; with the laser on, of the colour its light reaches least.

        A picture that cannot be decoded is None. Decoding continues in a thread while a picture is processed.
        """
        for frame, image in in_background(self._softened(self.recording.frames.frame[place]), _DECODED_AHEAD):
            yield int(self._place(np.array(frame))), image

    def strips(self, place: Int, T_pc: Float) -> Iterator[Strip | None]:
        """Yield frames (n,), ascending, unrolled from poses (n, 4, 4) in the straightened pipe."""
        for (_, image), T in zip(self.images(place), T_pc, strict=True):
            yield None if image is None else unroll(image, self.probe, T, self.grid, self.hidden)

    @property
    def _both(self) -> bool:
        """Whether LEDs and laser are on in the same frames."""
        return bool(np.any(self.recording.frames.illumination == Illumination.BOTH.value))

    def _place(self, frame: Int) -> Int:
        return np.asarray(np.searchsorted(self.recording.frames.frame, frame))

    def _softened(self, frame: Int) -> Iterator[tuple[int, Image | None]]:
        channel = darkest_channel(self.probe.laser)
        for number, image in self.recording.read(frame, "bgr" if self._both else "grey"):
            grey = np.ascontiguousarray(image[..., channel]) if image is not None and self._both else image
            yield number, None if grey is None else softened(grey)


def softened(image: Image) -> Image:
    """Return a grey image (H, W) without noise finer than a strip sample, which would alias into it."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), SOFTENING_PX), np.uint8)


def unroll(image: Image, probe: Probe, T_pc: Float, grid: StripGrid, hidden: Hidden) -> Strip:
    """Unroll a `softened` grey image (H, W) as seen from pose ``T_pc`` (4, 4) in the straightened pipe."""
    first_row = int(np.ceil((T_pc[2, 3] + grid.near_mm) / grid.step_mm))
    coarse_uv, light = _coarse_view(probe, T_pc, grid, first_row)
    middle = len(coarse_uv) // 2
    halves = (coarse_uv[: middle + 1], coarse_uv[middle:])
    parts = side_by_side(lambda half: sample(image, half, _COARSE), halves)
    grey, seen = (np.concatenate(part) for part in zip(*parts, strict=True))
    ahead = (first_row + np.arange(grid.rows)) * grid.step_mm - T_pc[2, 3]
    seen[(ahead > hidden.line_mm[0]) & (ahead < hidden.line_mm[1])] = False
    if hidden.stays is not None:
        seen &= sample(hidden.stays, coarse_uv, _COARSE)[0] == 0
    some = grey[:: _COARSE[0]][seen[:: _COARSE[0]]]
    lit = len(some) and np.ptp(np.percentile(some, (1, 99))) > _DARKEST  # beyond noise, hot pixels, letters
    usable = seen & (grey < _BRIGHTEST) & (grey > _DARKEST) & bool(lit)
    contrast = without_illumination(grey / _refined(light, _COARSE), usable)
    contrast = equally_sharp(contrast, coarse_uv, _COARSE)
    return Strip(first_row, contrast, usable, coarse_uv, noise_of_rows(contrast, usable))


def _coarse_view(probe: Probe, T_pc: Float, grid: StripGrid, first_row: int) -> tuple[Float32, Float32]:
    """Return pixels (H/8 + 1, W/4 + 1, 2) of every eighth row and fourth column, and the light there.

    The LEDs' light is predicted, up to a factor: off the axis it is uneven around the wall.
    """
    rows = first_row + _COARSE[0] * np.arange(grid.rows // _COARSE[0] + 1.0)
    xyz = grid.wall(rows[:, None], _COARSE[1] * np.arange(grid.columns // _COARSE[1] + 1.0))
    T_cp = inverse(T_pc)
    xyz_c = transform(T_cp, xyz)
    normal_c = (xyz * [-1 / grid.radius_mm, -1 / grid.radius_mm, 0.0]) @ T_cp[:3, :3].T
    light = irradiance(probe.lighting, xyz_c, normal_c)
    light = np.maximum(light, _LEAST_LIGHT * light.max(initial=1e-12)) / light.mean()
    return probe.camera.project(xyz_c).uv.astype(np.float32), light.astype(np.float32)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _refine(coarse, row, steps, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (W,) with a row of the bilinear refinement of values on a grid of so many ``steps``."""
    m, a, step = row // steps[0], np.float32((row % steps[0]) / steps[0]), steps[1]
    before = coarse[m, 0] + a * (coarse[m + 1, 0] - coarse[m, 0])
    for n in range(1, coarse.shape[1]):
        after = coarse[m, n] + a * (coarse[m + 1, n] - coarse[m, n])
        slope = (after - before) / np.float32(step)
        for k in range(step):
            out[(n - 1) * step + k] = before + np.float32(k) * slope
        before = after


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _refined(coarse, steps):  # type: ignore[no-untyped-def]
    """Return the bilinear refinement (H, W) of values at every so many rows and columns."""
    out = np.empty(((coarse.shape[0] - 1) * steps[0], (coarse.shape[1] - 1) * steps[1]), np.float32)
    for row in range(out.shape[0]):
        _refine(coarse, row, steps, out[row])
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def sample(image, coarse, steps):  # type: ignore[no-untyped-def]
    """Return the image (H, W), sampled bilinearly on the coarse pixel grid refined by ``steps``.

    The second array (H, W) marks the samples that lie in the image.
    """
    rows, columns = (coarse.shape[0] - 1) * steps[0], (coarse.shape[1] - 1) * steps[1]
    grey = np.zeros((rows, columns), np.float32)
    seen = np.zeros((rows, columns), np.bool_)
    u, v = np.empty(columns, np.float32), np.empty(columns, np.float32)
    height, width = image.shape
    flat = image.ravel()
    for i in range(rows):
        _refine(coarse[:, :, 0], i, steps, u)
        _refine(coarse[:, :, 1], i, steps, v)
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
