"""Check a finding against lit pictures taken while the laser line passed it.

A drop that runs down the window displaces the line and the texture beside it alike. The pictures taken while
the line passes the finding then show the wall displaced along the pipe by as much as the line, and those
taken when the line was elsewhere do not; a defect displaces no texture. Which share of the line's
displacement the texture shows, 1 under a drop and 0 on the wall, is one number with a σ: what other pictures
of the same place are displaced by against each other, and the same pictures at other places around the pipe.
So a wrong pose, a lens that is not known well, a reflection that moves with the camera and noise make the
share unknown. Displacement around the pipe tells nothing: it does not move the line off its place.
On a plain wall only the defect may have texture: no other place can then show that the pose was wrong, and
nothing is told.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Byte, Float, Float32, Int
from pipeline.geometry.axis import from_pipe
from pipeline.geometry.rigid import inverse, transform
from pipeline.recording.base import Illumination
from stages.defects.depth import KNOWN
from stages.defects.parallax import LitPictures
from stages.defects.relief import Relief
from stages.defects.segment import Region

# A window of the wall extends 4 mm beyond the line along the pipe, and is 8 mm wide at least; points lie
# 0.25 mm apart, and shifts of up to 1.5 mm are tried. Of the frames in which both lights are on, the wall
# within 1.5 mm of the line is not used. What is broader than 2 mm (8 points) is taken for light and removed.
_HALF_MM, _PIXEL_MM, _SHIFT_PX, _LINE_MM, _BROAD_PX = 4.0, 0.25, 6, 1.5, 8.0
# Up to 6 pictures are taken while the line passes, and for each up to 8, at least 4, whose line is beyond the
# window, at most 15 mm away: farther off the wall is seen too obliquely. At most twice 12 are read. Other
# places: 8 around the pipe.
_PASSING, _OTHERS, _LEAST_OTHERS, _READ, _FARTHEST_MM, _TURNS = 6, 8, 4, 12, 15.0, 8
# A plain wall is not seen to be displaced: places count whose pictures agree, after the best shift, at least
# half as well as those of the finding (chosen).
_TEXTURED = 0.5
_EXACT = 1e-9  # keeps a division defined where nothing correlates
# The share is nearer to that of a drop than to that of a defect from here on. A drop does not displace all
# texture alike: shares were .5 to 1.5 under seven painted drops, −.26 to .39 at seven true defects, and .60
# with a σ of .7 at an eighth, which a codec displaced.
_BETWEEN = 0.5


@dataclass(frozen=True)
class _Pictures:
    """Lit pictures (H, W), poses P to C, distances of the line, mm, and whether the laser is on, too."""

    image: list[Byte]
    T_cp: Float
    line_mm: Float
    both: Bool

    def beside(self, k: int) -> Int:
        """Return the pictures whose line is beyond the window of the picture ``k``, but not far."""
        off = np.abs(self.line_mm - self.line_mm[k])
        return np.flatnonzero((off > _HALF_MM + _LINE_MM) & (off < _FARTHEST_MM))


@dataclass(frozen=True)
class _Shift:
    """How far a picture is displaced along the pipe at a place, in points, and as far as its line shows.

    Attributes
    ----------
    seen, of_line : float
        Displacement of the texture, and of the line.
    of_others : (n,)
        Displacement of each other picture against the rest.
    agrees : float
        Correlation with the others after the shift.
    """

    seen: float
    of_line: float
    of_others: Float
    agrees: float


def shows_drop(pictures: LitPictures, region: Region, relief: Relief) -> bool:
    """Whether pictures show the wall displaced at a finding, like the line, while the line passed it.

    The rows of ``region`` count from the first row of ``relief``.
    """
    if region.all_round:
        return False
    s = relief.distance_mm[region.row : region.row + len(region.mask)]
    lit = _pictures(pictures, float(s[0]), float(s[-1]))
    columns = np.flatnonzero(region.mask.any(0)) + region.column
    half = max(len(columns), 2 * _HALF_MM / relief.cell_mm[1]) / 2
    around = columns.mean() + np.arange(-half, half, _PIXEL_MM / relief.cell_mm[1])
    turn = len(relief.azimuth_rad) / (_TURNS + 1)

    def shifts(k: int, places: range) -> list[_Shift]:
        windows = (_window(relief, lit.line_mm[k], around + n * turn) for n in places)
        found = (_shift(pictures, lit, k, _some(lit.beside(k), _OTHERS), window) for window in windows)
        return [shift for shift in found if shift is not None]

    passing = _some(np.flatnonzero((lit.line_mm >= s[0]) & (lit.line_mm <= s[-1])), _PASSING)
    enough = [k for k in passing if len(lit.beside(k)) >= _LEAST_OTHERS]
    own = {k: shift[0] for k in enough if (shift := shifts(k, range(1)))}
    of_line = np.array([shift.of_line for shift in own.values()])
    if not of_line.any():
        return False
    share = of_line @ [shift.seen for shift in own.values()] / (of_line @ of_line)
    if share <= _BETWEEN:
        return False  # as almost always: other places need not be compared
    least = _TEXTURED * float(np.median([shift.agrees for shift in own.values()]))
    around_pipe = [
        there.seen for k in own for there in shifts(k, range(1, _TURNS + 1)) if there.agrees > least
    ]
    at_other_times = np.concatenate([shift.of_others for shift in own.values()])
    one_sigma = max(robust_spread(at_other_times), robust_spread(np.array(around_pipe or [np.inf])))
    unsure = max(KNOWN * one_sigma / float(np.linalg.norm(of_line)), _BETWEEN)
    return bool(unsure < share < 1 + unsure)


def _pictures(pictures: LitPictures, first_mm: float, last_mm: float) -> _Pictures:
    """Return lit pictures taken while the line passed a stretch of the wall, and before and after that."""
    motion, recording = pictures.motion, pictures.recording
    index = np.flatnonzero(np.isin(motion.frame, recording.frames.of(Illumination.LED, Illumination.BOTH)))
    line = pictures.line_mm[index]
    off = np.maximum(first_mm - line, line - last_mm)
    some = np.union1d(_some(index[off <= 0], _READ), _some(index[(off > 0) & (off < _FARTHEST_MM)], _READ))
    read = recording.read(motion.frame[some], "grey")
    image = {k: np.array(i) for k, (_, i) in zip(some, read, strict=True) if i is not None}
    kept = np.array(list(image), np.int64)
    both = np.isin(motion.frame[kept], recording.frames.of(Illumination.BOTH))
    return _Pictures(list(image.values()), inverse(motion.T_pc[kept]), pictures.line_mm[kept], both)


def _some(index: Int, most: int) -> Int:
    """Return some of a list (n,), evenly."""
    return np.asarray(index[np.unique(np.linspace(0, len(index) - 1, min(len(index), most)).astype(int))])


def _window(relief: Relief, line_mm: float, column: Float) -> tuple[Float, Float, Float, Float]:
    """Return distance, azimuth, radius of the smooth wall and height on it (n, m) about a line."""
    s = np.arange(line_mm - _HALF_MM, line_mm + _HALF_MM, _PIXEL_MM)
    s = s[(s >= relief.distance_mm[0]) & (s <= relief.distance_mm[-1])]
    row = (s - relief.distance_mm[0]) / relief.cell_mm[0]
    i, j = np.meshgrid(row, column, indexing="ij")
    radius = relief.shape_at(i.ravel(), j.ravel()).reshape(i.shape)
    turn = len(relief.azimuth_rad)
    height = relief.local_mm[np.rint(i).astype(int), np.rint(j).astype(int) % turn]
    psi = relief.azimuth_rad[0] + j * 2 * np.pi / turn
    return np.broadcast_to(s[:, None], i.shape), psi, radius, np.nan_to_num(height).astype(float)


def _shift(
    pictures: LitPictures, lit: _Pictures, k: int, others: Int, window: tuple[Float, Float, Float, Float]
) -> _Shift | None:
    """Return how far picture ``k`` is displaced against others; None if too few pictures show the window.

    The wall is taken with the measured relief or without it, whichever lets the others agree better.
    """
    s, psi, radius, height = window
    if min(s.shape) <= 4 * _SHIFT_PX:
        return None
    seen = []
    for more in (height, np.zeros_like(height)):
        xyz_p = from_pipe(pictures.motion.axis, s, psi, radius + more)
        own, *its = (_texture(pictures, xyz_p, lit.image[i], lit.T_cp[i]) for i in (k, *others))
        known = np.array([t for t in its if t is not None])
        if own is not None and len(known) >= _LEAST_OTHERS:
            seen.append((float(known.mean(0).std() / known.std()), own, known))
    if not seen:
        return None
    _, own, known = max(seen, key=lambda each: each[0])
    used = np.abs(s - lit.line_mm[k]) > _LINE_MM * lit.both[k]
    total = known.sum(0)
    shift, agrees = _along(own, total, used)
    of_others = np.array([_along(t, total - t, used)[0] for t in known])
    at_line = int(np.argmin(np.abs(s[:, 0] - lit.line_mm[k])))
    # A ray that is turned a little meets the sheet farther out, and the wall nearer by, in this ratio.
    legs = pictures.probe.laser.baseline_mm / radius[at_line]
    return _Shift(shift, float(np.mean(height[at_line] * legs)) / _PIXEL_MM, of_others, agrees)


def _texture(pictures: LitPictures, xyz_p: Float, image: Byte, T_cp: Float) -> Float32 | None:
    """Return the fine texture (n, m) of wall points in a picture; None unless it shows all."""
    uv, valid = pictures.probe.camera.project(transform(T_cp, xyz_p))
    u, v = (uv[..., k].astype(np.float32) for k in (0, 1))
    within = valid & (u > 1) & (v > 1) & (u < image.shape[1] - 2) & (v < image.shape[0] - 2)
    if not within.all():
        return None
    left, top = int(u.min()), int(v.min())
    part = image[top : int(v.max()) + 2, left : int(u.max()) + 2].astype(np.float32)
    grey = cv2.remap(part, u - left, v - top, cv2.INTER_LINEAR)
    return np.asarray(grey - cv2.GaussianBlur(grey, (0, 0), _BROAD_PX), np.float32)


def _along(texture: Float32, others: Float32, used: Bool) -> tuple[float, float]:
    """Return the displacement along the pipe at which a texture correlates best with the others (n, m).

    It is in points, positive against the camera's way, with the correlation there. Only points that are
    ``used`` count.
    """
    inner = (slice(_SHIFT_PX, -_SHIFT_PX),) * 2
    mask = used[inner].astype(np.float32)
    found = np.nan_to_num(cv2.matchTemplate(others, texture[inner], cv2.TM_CCOEFF_NORMED, mask=mask))
    row, column = np.unravel_index(int(found.argmax()), found.shape)
    best = float(found[row, column])
    if not 0 < row < len(found) - 1:
        return float(row - _SHIFT_PX), best
    before, after = float(found[row - 1, column]), float(found[row + 1, column])
    top = 0.5 * (before - after) / min(before - 2 * best + after, -_EXACT)
    return float(row - _SHIFT_PX) + top, best
