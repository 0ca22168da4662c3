"""Examines every picture once: brightness of the wall, closed laser line, and motion since the last one."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Image
from pipeline.instrument.camera import Camera
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from pipeline.system.parallel import in_threads
from stages.premises.stays import in_full

# Rays of the polar picture: tens of them already distinguish a closed line from chance.
_RAYS, _THREADS = 128, 2
# A line is closed when it goes round more than half of the circle.
CLOSED = 0.5
# Part of the distance from the centre to the nearer edge of the picture that is examined.
_NEAREST, _FARTHEST = 0.15, 0.98
# A laser line is thinner than this part of the picture's height, or it could not be measured to a tenth of
# a millimetre; twice as much is left around it for blur and ghosts.
_THICKEST_LINE = 0.03
# A line goes on if both neighbouring rays show it, less than so many times fainter: along the lines of open-1
# to open-3 its brightness varies up to threefold from ray to ray.
_GOES_ON = 4
# Polar angles between which the wall is unrolled to see the motion; as in motion, with less at either end.
_NEAR_DEG, _FAR_DEG = 76.0, 35.0
_ROWS, _COLUMNS = 128, 256
# Rows that are enough to see motion, share of a row that a line may cover, breadth of the lamps' light.
_LEAST_ROWS, _MOST_COVERED, _BROAD = 24, 0.1, 8.0
# Pictures kept for comparison: a light must come round again within so many frames.
_KEPT = 8
# Least share of the surroundings of a place that counts as known when its brightness is normalised. Not
# measured.
_LEAST_KNOWN = 0.05
# Share of the correlation that lies at its peak, below which the motion is unknown: a lit wall that moves
# shows .83 to .95 in open-1-field, one without texture .07 to .36.
_LEAST_PEAK = 0.4
# Every so many columns are examined for rows that were taken at two times.
_EVERY_COLUMN = 8
# Two pictures are taken in the same light when their brightness differs by less than this part.
_SAME_LIGHT = 0.3


@dataclass(frozen=True)
class Pictures:
    """Measurements of the F pictures of a recording, in the order of its frames.

    Attributes
    ----------
    brightness : (F,)
        Square root of the mean grey level without thin lines, so that shot noise is the same everywhere; NaN
        where a picture cannot be decoded.
    closed : (F,)
        Share of neighbouring rays on which the strongest thin line lies at the same radius.
    line_px : (F, R) float32
        Radius of the strongest thin line on each ray.
    azimuth_rad : (R,)
        Azimuth of the rays.
    combing : (F,)
        Power of the difference from one row to the next over that to the row after it: 1 at most in
        pictures taken at one time, more where odd and even rows show different times; NaN in a black one.
    partner : (F,) int
        The latest earlier picture in the same light, −1 without one.
    change : (F,)
        Mean difference to the partner, grey levels, whatever the exposures.
    step : (F,)
        Motion along the pipe since the partner was taken, in pipe radii; NaN without partner and where
        the wall does not show it.
    """

    brightness: Float
    closed: Float
    line_px: Float32
    azimuth_rad: Float
    combing: Float
    partner: np.ndarray[tuple[int], np.dtype[np.int64]]
    change: Float
    step: Float

    @property
    def seen(self) -> Bool:
        """(F,) true where the picture could be decoded."""
        return np.isfinite(self.brightness)


def examine_pictures(
    recording: Recording, probe: Probe, context: Context, stays: Bool | None = None
) -> Pictures:
    """Examine every picture of a recording once; places where something ``stays`` (h, w) show no motion."""
    polar = _PolarView(recording.source.image_size, probe.camera.centre_px)
    motion = _AxialMotion(probe.camera, polar.line_width_px, stays)
    count = len(recording.frames.frame)
    seen = _empty(count, polar.azimuth_rad)

    def look(place: int, image: Image | None) -> _Strip | None:
        if image is None:
            return None
        wall, line = polar.wall_and_line(image)
        seen.combing[place] = combing(image)
        seen.brightness[place] = np.sqrt(float(wall.mean()))
        seen.closed[place], seen.line_px[place] = polar.closed_line(line)
        ring = seen.line_px[place] if seen.closed[place] > CLOSED else None
        return motion.strip(place, seen.brightness[place], image, ring)

    images = recording.read(recording.frames.frame, "grey")
    strips = in_threads(lambda given: look(given[0], given[1][1]), enumerate(images), _THREADS)
    for place, strip in enumerate(strips):
        if strip is not None:
            seen.partner[place], seen.change[place], seen.step[place] = motion.since(strip)
        context.progress(place + 1, count)
    return seen


def _empty(count: int, azimuth_rad: Float) -> Pictures:
    nothing = (np.full(count, np.nan) for _ in range(5))
    brightness, closed, combed, change, step = nothing
    line = np.full((count, len(azimuth_rad)), np.nan, np.float32)
    return Pictures(brightness, closed, line, azimuth_rad, combed, np.full(count, -1), change, step)


def combing(image: Image) -> float:
    """Return how much more neighbouring rows of a picture (H, W) differ than rows two apart; a ratio."""
    rows = np.ascontiguousarray(image[:, ::_EVERY_COLUMN])
    squares = (cv2.norm(rows[n:], rows[:-n], cv2.NORM_L2SQR) / rows[n:].size for n in (1, 2))
    next_row, next_but_one = squares
    return next_row / next_but_one if next_but_one > 0 else float("nan")


class _PolarView:
    """A picture resampled along rays from the centre: rows are rays, columns radii."""

    def __init__(self, image_size: tuple[int, int], centre_px: Float) -> None:
        half = min(image_size) / 2
        self.azimuth_rad = np.linspace(-np.pi, np.pi, _RAYS, endpoint=False)
        self._radius = np.arange(_NEAREST * half, _FARTHEST * half, dtype=np.float32)
        direction = np.stack([np.cos(self.azimuth_rad), np.sin(self.azimuth_rad)]).astype(np.float32)
        self._uv = np.asarray(centre_px, np.float32)[:, None, None] + direction[..., None] * self._radius
        self.line_width_px = round(_THICKEST_LINE * 2 * half) | 1

    def wall_and_line(self, image: Image) -> tuple[Image, Image]:
        """Return the wall without structures thinner than a line, and those structures (a top-hat)."""
        polar = np.asarray(cv2.remap(image, self._uv[0], self._uv[1], cv2.INTER_LINEAR), np.uint8)
        wall = cv2.morphologyEx(polar, cv2.MORPH_OPEN, np.ones((1, self.line_width_px), np.uint8))
        return np.asarray(wall, np.uint8), np.asarray(cv2.subtract(polar, wall), np.uint8)

    def closed_line(self, line: Image) -> tuple[float, Float32]:
        """Return the share of neighbouring rays with the strongest line at one radius, and the radii (R,)."""
        line = _that_goes_on(line, self.line_width_px)
        strongest = line.argmax(1)
        beside = np.abs(strongest - np.roll(strongest, 1)) <= self.line_width_px // 2
        there = line.max(1) > 0
        return float((beside & there).mean()), self._radius[strongest]


def _that_goes_on(line: Image, width_px: int) -> Image:
    """Return thin structures (R, N) without those that end within a ray: hot pixels, hits of radiation."""
    near = cv2.dilate(line, np.ones((1, width_px), np.uint8))
    beside = np.minimum(np.roll(near, 1, axis=0), np.roll(near, -1, axis=0))
    return np.where(line <= _GOES_ON * beside.astype(np.uint16), line, np.uint8(0))


@dataclass(frozen=True)
class _Strip:
    """An unrolled wall: number of its picture, brightness, grey levels, and the rows without a laser line.

    ``normalised`` holds the parts, by first row and end, from which the lamps' light was removed.
    """

    place: int
    brightness: float
    grey: Float32
    first: int
    end: int
    normalised: dict[tuple[int, int], Float32] = field(default_factory=dict)


class _AxialMotion:
    """Measures the motion of the unrolled wall between pictures in the same light."""

    def __init__(self, camera: Camera, line_width_px: int, stays: Bool | None) -> None:
        near, far = (1 / np.tan(np.radians(a)) for a in (_NEAR_DEG, _FAR_DEG))
        z = np.linspace(near, far, _ROWS)
        psi = np.linspace(-np.pi, np.pi, _COLUMNS, endpoint=False)
        wall = np.stack(np.broadcast_arrays(np.cos(psi), np.sin(psi), z[:, None]), -1)
        self._uv = camera.project(wall).uv.astype(np.float32)
        from_centre = self._uv - np.asarray(camera.centre_px, np.float32)
        self._radius_px = np.hypot(from_centre[..., 0], from_centre[..., 1])
        self._ray = np.arange(_COLUMNS) * _RAYS // _COLUMNS
        self._line_width_px = line_width_px
        self._u, self._v = (np.ascontiguousarray(self._uv[..., k]) for k in range(2))
        self._moves = _moving(stays, camera.image_size, self._uv)
        self._known: dict[tuple[int, int], Float32] = {}
        self._radii_per_row = float(z[1] - z[0])
        self._kept: deque[_Strip] = deque(maxlen=_KEPT)

    def strip(self, place: int, brightness: float, image: Image, line_px: Float32 | None) -> _Strip:
        """Return the wall unrolled.

        Rows with a laser line, at ``line_px`` on each ray, are left out: it does not move with the wall.
        """
        grey = cv2.remap(image, self._u, self._v, cv2.INTER_LINEAR).astype(np.float32)
        return _Strip(place, brightness, grey, *self._free_rows(line_px))

    def since(self, strip: _Strip) -> tuple[int, float, float]:
        """Return the latest picture in the same light, the difference to it, and the motion in pipe radii."""
        before = next((k for k in reversed(self._kept) if _in_like_light(k, strip)), None)
        self._kept.append(strip)
        if before is None:
            return -1, np.nan, np.nan
        change = change_between(before.grey, strip.grey)
        rows = slice(max(strip.first, before.first), min(strip.end, before.end))
        if rows.stop - rows.start < _LEAST_ROWS:
            return before.place, change, np.nan
        one, other = (self._stored_normalised(s, rows) for s in (before, strip))
        window = cv2.createHanningWindow(one.shape[::-1], cv2.CV_32F)
        (_, moved), peak = cv2.phaseCorrelate(one, other, window)
        return before.place, change, -moved * self._radii_per_row if peak > _LEAST_PEAK else np.nan

    def _stored_normalised(self, strip: _Strip, rows: slice) -> Float32:
        """Return `_normalised` rows of a strip, stored for the picture that will be compared with it."""
        part = rows.start, rows.stop
        if part not in strip.normalised:
            strip.normalised[part] = self._normalised(strip, rows)
        return strip.normalised[part]

    def _normalised(self, strip: _Strip, rows: slice) -> Float32:
        """Return rows of a strip without the lamps' light, every row with a spread of 1.

        Places where something stays are filled with noise: gaps of one shape would make the wall seem to
        stand still.
        """
        grey, moves = strip.grey[rows], self._moves[rows]
        light = cv2.GaussianBlur(grey * moves, (0, 0), _BROAD)
        fine = (grey - light / self._share_known(rows)) * moves
        fine -= fine.mean(1, keepdims=True)
        spread = np.sqrt(np.einsum("ij,ij->i", fine, fine) / fine.shape[1])
        fine /= np.maximum(spread, 1.0)[:, None]
        if moves.all():
            return np.asarray(fine, np.float32)
        noise = np.random.default_rng(strip.place).standard_normal(fine.shape)
        return np.where(moves > 0, fine, noise).astype(np.float32)

    def _share_known(self, rows: slice) -> Float32:
        """Return the share of the surroundings of each place that moves with the wall."""
        part = rows.start, rows.stop
        if part not in self._known:
            known = cv2.GaussianBlur(self._moves[rows], (0, 0), _BROAD)
            self._known[part] = np.maximum(known, _LEAST_KNOWN).astype(np.float32)
        return self._known[part]

    def _free_rows(self, line_px: Float32 | None) -> tuple[int, int]:
        """Return the longest run of rows of which the laser line covers a tenth at most."""
        if line_px is None:
            return 0, _ROWS
        on_line = np.abs(self._radius_px - line_px[self._ray]) < self._line_width_px / 2
        covered = np.flatnonzero(on_line.mean(1) > _MOST_COVERED)
        edges = np.concatenate([[-1], covered, [_ROWS]])
        longest = int(np.argmax(np.diff(edges)))
        return int(edges[longest]) + 1, int(edges[longest + 1])


def change_between(one: Float32, other: Float32) -> float:
    """Return the mean difference of two pictures, grey levels, as if both had the mean of their exposures.

    Otherwise, in a recording with flickering exposure, two neighbouring pictures of equal exposure would
    differ by far less than usual, and the second would be taken for a copy.
    """
    power = float(np.vdot(one, one)), float(np.vdot(other, other))
    brighter = np.float32((power[1] / power[0]) ** 0.25 if min(power) > 0 else 1.0)
    return cv2.norm(other / brighter, brighter * one, cv2.NORM_L1) / one.size


def _in_like_light(one: _Strip, other: _Strip) -> bool:
    brighter = max(one.brightness, other.brightness)
    return abs(one.brightness - other.brightness) < _SAME_LIGHT * brighter


def _moving(stays: Bool | None, image_size: tuple[int, int], uv: Float32) -> Float32:
    """Return 1 where pixels (r, c, 2) see moving wall, 0 outside the picture and where it ``stays``."""
    size = np.array(image_size, np.float32)
    inside = ((uv > 0) & (uv < size - 1)).all(-1)
    whole = in_full(stays, image_size)
    if whole is not None:
        inside &= cv2.remap(whole, uv[..., 0], uv[..., 1], cv2.INTER_NEAREST) == 0
    return np.asarray(inside, np.float32)
