"""Check a finding against lit pictures taken while the laser line passed it.

A drop that runs down the window displaces the line and the texture beside it alike. The pictures taken while
the line passes the finding then show the wall displaced there, and those taken when the line was elsewhere do
not. Displaced texture agrees better with these after a shift. Noise gains by the best of many shifts, too,
and a wrong depth, pose or lens displaces texture at any time or all around. So the gain is compared with that
of the other pictures at the same place, and with that of the same pictures at other places around the pipe:
it counts only where it is larger than both. A reflection on glossy wall moves with the camera at any time:
the pictures taken before do not agree with those taken after either. What these gain by a shift counts like
another's gain, and if they agree too little nothing is told.
On a plain wall only the defect may have texture: no other place can then show that the pose was wrong, and
nothing is told.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Bool, Byte, Float, Float32, Int
from pipeline.geometry.axis import distance_along, from_pipe
from pipeline.geometry.rigid import inverse, transform
from pipeline.recording.base import Illumination
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
# The gain must be larger by this factor, and .01 at least. Of other places the upper quartile counts: more of
# them may lie under drops. Debt: data/debts.md. A plain wall is not seen to be displaced: places count whose
# pictures agree, after the best shift, at least half as well as those of the finding; and so must pictures
# taken before and after agree without a shift (chosen).
_LARGER, _LEAST_GAIN, _UPPER, _TEXTURED = 2.0, 0.01, 0.75, 0.5


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


def shows_drop(pictures: LitPictures, region: Region, relief: Relief) -> bool:
    """Whether pictures show the wall displaced at a finding, but only while the line passed it.

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

    def gains(k: int, places: range) -> list[tuple[float, float, float] | None]:
        windows = (_window(relief, lit.line_mm[k], around + n * turn) for n in places)
        return [_gains(pictures, lit, k, _some(lit.beside(k), _OTHERS), window) for window in windows]

    passing = _some(np.flatnonzero((lit.line_mm >= s[0]) & (lit.line_mm <= s[-1])), _PASSING)
    found = {k: gains(k, range(1))[0] for k in passing if len(lit.beside(k)) >= _LEAST_OTHERS}
    own = {k: gain for k, gain in found.items() if gain is not None}
    if not own:
        return False
    there, at_other_times, agrees = np.median(list(own.values()), axis=0)
    if there <= max(_LARGER * at_other_times, _LEAST_GAIN):
        return False  # as almost always: other places need not be compared
    around_pipe = [[g for g in gains(k, range(1, _TURNS + 1)) if g is not None] for k in own]
    known = [[g[0] for g in places if g[2] > _TEXTURED * agrees] for places in around_pipe]
    elsewhere = [np.quantile(gain, _UPPER) for gain in known if gain]
    return bool(elsewhere and there > _LARGER * np.median(elsewhere))


def _pictures(pictures: LitPictures, first_mm: float, last_mm: float) -> _Pictures:
    """Return lit pictures taken while the line passed a stretch of the wall, and before and after that."""
    motion, recording = pictures.motion, pictures.recording
    index = np.flatnonzero(np.isin(motion.frame, recording.frames.of(Illumination.LED, Illumination.BOTH)))
    line = distance_along(motion.axis, motion.T_pc[index]) + pictures.probe.laser.baseline_mm
    off = np.maximum(first_mm - line, line - last_mm)
    some = np.union1d(_some(index[off <= 0], _READ), _some(index[(off > 0) & (off < _FARTHEST_MM)], _READ))
    read = recording.read(motion.frame[some], "grey")
    image = {k: np.array(i) for k, (_, i) in zip(some, read, strict=True) if i is not None}
    kept = np.array(list(image), np.int64)
    T_pc = motion.T_pc[kept]
    line = distance_along(motion.axis, T_pc) + pictures.probe.laser.baseline_mm
    both = np.isin(motion.frame[kept], recording.frames.of(Illumination.BOTH))
    return _Pictures(list(image.values()), inverse(T_pc), line, both)


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


def _gains(
    pictures: LitPictures, lit: _Pictures, k: int, others: Int, window: tuple[Float, Float, Float, Float]
) -> tuple[float, float, float] | None:
    """Return the gain of picture ``k`` by a shift, the usual gain of others, and how well ``k`` then agrees.

    The usual gain is the median of the others, or the gain of those before and after against each other if
    it is larger. None is returned if too few pictures show the window, or if these two agree less than half
    as well as ``k`` does after its shift.

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
        after = (lit.line_mm[others] > lit.line_mm[k])[[t is not None for t in its]]
        if own is not None and len(known) >= _LEAST_OTHERS:
            seen.append((float(known.mean(0).std() / known.std()), own, known, after))
    if not seen:
        return None
    _, own, known, after = max(seen, key=lambda each: each[0])
    used = np.abs(s - lit.line_mm[k]) > _LINE_MM * lit.both[k]
    total = known.sum(0)
    gain, agrees = _gain(own, total, used)
    usual = float(np.median([_gain(t, total - t, used)[0] for t in known]))
    one_sided = after.all() or not after.any()
    moves, best = (0.0, agrees) if one_sided else _gain(known[after].sum(0), known[~after].sum(0), used)
    if best - moves < _TEXTURED * agrees:
        return None
    return gain, max(usual, moves), agrees


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


def _gain(texture: Float32, others: Float32, used: Bool) -> tuple[float, float]:
    """Return by how much the correlation with the others (n, m) grows by the best shift, and how large it is.

    Only points that are ``used`` count.
    """
    inner = (slice(_SHIFT_PX, -_SHIFT_PX),) * 2
    found = cv2.matchTemplate(
        others, texture[inner], cv2.TM_CCOEFF_NORMED, mask=used[inner].astype(np.float32)
    )
    found = np.nan_to_num(found)
    return float(found.max() - found[_SHIFT_PX, _SHIFT_PX]), float(found.max())
