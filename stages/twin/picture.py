"""Laws of whole pictures: blur by motion, response, stray light, bloom, a second line.

Every frame gives the size of each law by itself, from least squares over its pixels or blocks; a size counts
if frames agree on it beyond chance. Laws that act on texture are columns beside those of exposure and of a
displaced photo, which they must not be taken for. A change of σ² of the blur along a direction α changes the
picture by σ²/2 · d²L/dα².
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy.ndimage import median_filter

from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import chance_of, sigmas
from stages.twin.compare import of_blocks
from stages.twin.locate import FALSE_ALARM
from stages.twin.scene import Scene
from stages.twin.state import Region, TwinFrame

_SURE, FEWEST_FRAMES, _STEP, _TILE = 3.0, 6, 2, 16
"""σ by which laws are told apart; frames; every second pixel; side of tiles that halve a picture."""
LEAST_BLUR_PX = 0.7
"""Least motion blur that is named, 1 σ: as much as a sharp lens and a pixel blur by themselves."""
_ONE_WAY = 0.6
"""Least share of a blur that has a direction: 1 for motion alone; of defocus a quarter seems to have one."""
OF_LAW = 0.2
"""Relative 1 σ of a blur for want of its shape: texture as fine as the blur is long bends more than by its
second derivative."""
_LEAST_LEVEL = 1.0
"""Least stray light that is named, grey levels: what rounding alone cannot make."""
_FINE_PX, _KEPT = 9, 1.0
"""Window that fine texture is held against, and share of its energy above which nothing is blurred."""
_DIRECTIONS = ("even", "across", "slanted", "radial")
_TRIMMED, _LEAST_SPREAD = 4, 0.1
"""Rounds of leaving out blocks that differ, and least spread of blocks, grey levels."""
_BLOOM_PX, _CLIPPED, _LEAST_BLOOM, _NEAR = 6.0, 200, 0.01, 0.02
"""Way along a column that leaves 1/e of the bloom, pixels that must clip, least leak and spread."""
_RATIOS, _REACH, _FAR_WIDTHS, _LEAST_LINE, _AROUND = 400, 0.8, 14.0, 0.01, 25
"""Bins and reach of ln(radius over the line's), px that belong to the line, least share of a second one,
and bins about each that tell what it stands out from."""


@dataclass
class WholePictures:
    """Collects what single frames say of laws of the whole picture; see `found`.

    Attributes
    ----------
    scene : Scene
    blur, kept, stray, bloom, ghost : list
        Of each frame: own and cross sums of both halves; share of the fine texture's energy; sizes of ambient
        and bounced light, their levels and falls; leak along columns and rows; brightness over ln of the
        ratio of radii in four quadrants.
    frame : dict of str to list of int
    """

    scene: Scene
    blur: list[tuple[Float, Float]] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    stray: list[Float] = field(default_factory=list)
    bloom: list[Float] = field(default_factory=list)
    ghost: list[Float] = field(default_factory=list)
    frame: defaultdict[str, list[int]] = field(default_factory=lambda: defaultdict(list))

    def _mismatch(
        self, name: str, fixed_to: str, size: NamedFigure, chance: float, of: str, said: str,
        place: tuple[NamedFigure, ...] = (),
    ) -> Mismatch:  # fmt: skip
        channel, at = "line" if fixed_to == "line" else "intensity", self.frame[of][0]
        look = self.scene.ring.whole(at)
        return Mismatch(name, channel, fixed_to, place, (size,), chance, np.nan, np.nan, said, look)

    def add_lit(self, frame: int, above: Float32, twin: TwinFrame, free: Bool) -> None:
        """Take a lit frame (H, W) whose twin has its exposure; pixels in ``free`` are not clipped."""
        inner = (slice(_STEP, -_STEP, _STEP),) * 2
        use = cv2.erode((free & (twin.region == Region.WALL)).astype(np.uint8), np.ones((5, 5), np.uint8))
        at = np.flatnonzero(use[inner])
        if len(at) < _TILE**2:
            return
        columns = self._columns(twin.level, inner).reshape(-1, use[inner].size)[:, at]
        weight = np.asarray(1 / np.sqrt(twin.variance[inner].ravel()[at]), np.float32)
        columns, rest = columns * weight, (above - twin.level)[inner].ravel()[at] * weight
        row, column = np.unravel_index(at, use[inner].shape)
        half = (row // _TILE + column // _TILE) % 2
        sums = [(c @ c.T, c @ rest[half == h]) for h in (0, 1) for c in [columns[:, half == h]]]
        self.blur.append((np.stack([s[0] for s in sums]).astype(float), np.stack([s[1] for s in sums])))
        fine = [(a - cv2.blur(a, (_FINE_PX, _FINE_PX)))[inner].ravel()[at] for a in (above, twin.level)]
        self.kept.append(float((fine[0] ** 2).sum() / max(float((fine[1] ** 2).sum()), 1e-9)))
        self.frame["blur"].append(frame)

    def _columns(self, level: Float32, inner: tuple[slice, slice]) -> Float32:
        """Return exposure and displacements, then blurs in `_DIRECTIONS`."""

        def at(down: int, right: int) -> Float32:
            both = zip((down, right), level.shape, strict=True)
            return np.asarray(level[tuple(slice(_STEP + d, n - _STEP + d, _STEP) for d, n in both)])

        here, phi = at(0, 0), self.scene.polar[1][inner]
        du, dv = (at(0, 1) - at(0, -1)) / 2, (at(1, 0) - at(-1, 0)) / 2
        uu, vv = at(0, 1) + at(0, -1) - 2 * here, at(1, 0) + at(-1, 0) - 2 * here
        uv = (at(1, 1) + at(-1, -1) - at(1, -1) - at(-1, 1)) / 4
        c, s = np.cos(phi), np.sin(phi)
        even, across = (uu + vv) / 2, (uu - vv) / 2
        radial = across * (c**2 - s**2) + uv * (2 * c * s)
        return np.stack([here, du, dv, c * du + s * dv, c * dv - s * du, even, across, uv, radial])

    def add_laser(self, frame: int, above: Float32, twin: TwinFrame, free: Bool, lit: TwinFrame) -> None:
        """Take a frame of the laser alone, and the twin that the LEDs would show from the same place."""
        line = (twin.region == Region.LINE_CORE) | (twin.region == Region.LINE_FLANK)
        away = cv2.dilate(line.astype(np.uint8), np.ones((9, 9), np.uint8)) == 0
        known = away & (lit.region == Region.WALL) & free
        glow = self._bounced(twin, lit)
        small = [of_blocks(np.where(known, a, 0)) for a in (np.ones_like(above), above, lit.level, glow)]
        whole = small[0] > 0.99
        if whole.sum() < _TILE**2:
            return
        value, *columns = (a[whole].astype(float) for a in small[1:])
        self.stray.append(np.array([_size_beside_one(value, c) for c in columns]))
        self.frame["stray"].append(frame)
        self._add_ghost(frame, above, twin, free & (twin.region != Region.EDGE))

    def _bounced(self, twin: TwinFrame, lit: TwinFrame) -> Float32:
        """Return light of the line bounced once in a round bore, up to a factor."""
        on_line = twin.distance_mm[twin.region == Region.LINE_CORE]
        middle = float(np.nanmedian(on_line)) if len(on_line) else np.nan
        x = np.abs(lit.distance_mm - np.float32(middle)) / np.float32(2 * self.scene.surface.mean_radius_mm)
        share = 1 - x * (2 * x**2 + 3) / (2 * (x**2 + 1) ** 1.5)
        return np.asarray(np.nan_to_num(100 * share), np.float32)

    def _add_ghost(self, frame: int, above: Float32, twin: TwinFrame, use: Bool) -> None:
        rows, columns = np.nonzero(twin.region == Region.LINE_CORE)
        u, v = self.scene.ring.centre_px
        degree = np.floor(np.degrees(np.arctan2(rows - v, columns - u)) + 180).astype(int) % 360
        count = np.bincount(degree, minlength=360)
        if (count == 0).mean() > 0.5:
            return
        radius = np.bincount(degree, np.hypot(rows - v, columns - u), 360) / np.maximum(count, 1)
        radius = np.interp(np.arange(360), np.flatnonzero(count), radius[count > 0], period=360)
        row, column = np.nonzero(use[::_STEP, ::_STEP])
        grey, away = above[::_STEP, ::_STEP][row, column], (_STEP * column - u, _STEP * row - v)
        turn = (np.degrees(np.arctan2(away[1], away[0])) + 180) % 360
        ratio = np.log(np.maximum(np.hypot(*away), 1) / radius[turn.astype(int) % 360])
        cell = np.floor((ratio / _REACH + 1) / 2 * _RATIOS).astype(int)
        inside = (cell >= 0) & (cell < _RATIOS)
        cell = (turn[inside] // 90).astype(int) % 4 * _RATIOS + cell[inside]
        total, pixels = (np.bincount(cell, w, 4 * _RATIOS) for w in (grey[inside], None))
        mean = np.where(pixels > 3, total / np.maximum(pixels, 1), np.nan)
        self.ghost.append(mean.reshape(4, _RATIOS))
        self.frame["ghost"].append(frame)

    def add_clipped(self, frame: int, above: Float32, twin: TwinFrame, free: Bool) -> None:
        """Take any frame: what leaks from clipped pixels along columns, and along rows for comparison."""
        if (~free).sum() < _CLIPPED:
            return
        reach = np.arange(-int(4 * _BLOOM_PX), int(4 * _BLOOM_PX) + 1)
        tail, one = np.exp(-np.abs(reach) / _BLOOM_PX), np.ones(1)
        full, tail = (~free).astype(np.float32), tail / tail.sum()
        spread = [cv2.sepFilter2D(full, -1, *k) for k in ((one, tail), (tail, one))]
        known = (twin.region != Region.UNSEEN) & (twin.region != Region.EDGE)
        near = free & known & (spread[0] + spread[1] > _NEAR)
        columns = np.stack([*(s[near] for s in spread), twin.level[near]]).astype(float)
        rest = (above - twin.level)[near].astype(float)
        own = columns @ columns.T + 1e-6 * np.eye(3)
        self.bloom.append(np.linalg.solve(own, columns @ rest)[:2])
        self.frame["bloom"].append(frame)

    def found(self, sharpness: Float) -> tuple[Mismatch, ...]:
        """Return what frames agree on; ``sharpness`` (Z,) is half the variance by which they are blurrier."""
        made = (self._motion_blur(sharpness), self._stray(), self._bloom(), self._second())
        return tuple(m for m in made if m is not None)

    def _blurs(self) -> Float:
        """Half the variances (F, 2, 4) that frames are blurred by, of both halves."""
        each = [[_blur_of(o, c) for o, c in zip(*frame, strict=True)] for frame in self.blur]
        return np.array(each).reshape(-1, 2, len(_DIRECTIONS))

    @property
    def loses_texture(self) -> bool:
        """Whether fine texture is fainter than the photo's: a photo displaced in itself only moves it."""
        return bool(self.kept) and float(np.mean(self.kept)) < _KEPT

    def even_blur(self, sharpness: Float) -> Float:
        """Return half the variance (F,), px², by which lit frames are blurrier than the photo all round."""
        return np.asarray(self._blurs()[:, :, 0].mean(1) + np.mean(sharpness))

    def _motion_blur(self, sharpness: Float) -> Mismatch | None:
        if len(self.blur) < FEWEST_FRAMES:
            return None
        each = self._blurs()
        uniform = (each[:, 0, 1:3] * each[:, 1, 1:3]).sum(1)
        radial = np.maximum(each[:, :, 3].mean(1), 0) ** 2 * np.sign(each[:, :, 3].mean(1))
        ways = ((uniform, "sideways"), (radial, "along the pipe"))
        product, way = max(ways, key=lambda p: float(p[0].mean()))
        size = float(np.sqrt(2 * np.sqrt(max(product.mean(), 0.0))))
        chance = chance_of(product)
        if size**2 / 2 < _ONE_WAY * self.even_blur(sharpness).mean():
            return None  # blur in all directions, which fine texture of one direction shows more
        if not self.loses_texture or size < LEAST_BLUR_PX or chance > FALSE_ALARM or sigmas(product) < _SURE:
            return None
        spread = float(product.std() / np.sqrt(len(product))) / max(float(product.mean()), 1e-12) / 4
        sd = size * float(np.hypot(spread, OF_LAW))
        return self._mismatch(
            "motion_blur", "time", NamedFigure("blur", size, sd, "px"), chance, "blur",
            f"Frames are blurred by {size:.1f} px (1 σ) {way}, and less across: they move while exposed.",
        )  # fmt: skip

    def _stray(self) -> Mismatch | None:
        if len(self.stray) < FEWEST_FRAMES:
            return None
        size, level, fall = np.moveaxis(np.stack(self.stray), -1, 0)
        k = int(np.argmax(fall.sum(0)))
        chance, share = chance_of(size[:, k]), float(size[:, k].mean())
        if chance > FALSE_ALARM or share * level[:, k].mean() < _LEAST_LEVEL:
            return None
        names = ["ambient_light", "interreflection"]
        told = sigmas(fall[:, k] - fall[:, 1 - k]) > _SURE
        name, grey = (names[k] if told else " or ".join(names)), share * level[:, k]
        sd = float(np.std(size[:, k])) / np.sqrt(len(size)) * float(level[:, k].mean())
        return self._mismatch(
            name, "wall", NamedFigure("level", float(grey.mean()), sd, "grey levels"), chance, "stray",
            f"With the LEDs off the wall away from the line is up to {grey.mean():.1f} grey levels bright: "
            "other light, the line's own from wall to wall, or what a codec keeps of the frame before.",
        )  # fmt: skip

    def _bloom(self) -> Mismatch | None:
        if len(self.bloom) < FEWEST_FRAMES:
            return None
        leak = np.stack(self.bloom) / 255.0
        more = leak[:, 0] - leak[:, 1]
        size, chance = float(more.mean()), chance_of(more)
        if chance > FALSE_ALARM or sigmas(more) < _SURE or size < _LEAST_BLOOM:
            return None
        figure = NamedFigure("leak", size, float(more.std()) / np.sqrt(len(more)), "of full scale")
        return self._mismatch(
            "bloom", "image", figure, chance, "bloom",
            f"Above and below clipped pixels the picture is {100 * size:.0f} % of full scale brighter than "
            "beside them: charge leaks along columns.",
        )  # fmt: skip

    def _second(self) -> Mismatch | None:
        if len(self.ghost) < FEWEST_FRAMES:
            return None
        stack = np.stack(self.ghost)
        at = (np.arange(_RATIOS) + 0.5) / _RATIOS * 2 * _REACH - _REACH
        line = float(np.where(np.abs(at) < 0.02, np.nan_to_num(stack), 0).max((1, 2)).mean())
        ground = median_filter(np.apply_along_axis(_without_gaps, -1, stack), (1, 1, _AROUND), mode="nearest")
        far = np.abs(at) * self.scene.ring.radius_px > _FAR_WIDTHS
        known = np.isfinite(stack) & far
        excess, count = np.where(known, np.nan_to_num(stack) - ground, 0.0), np.maximum(known.sum(0), 1)
        mean = excess.sum(0) / count
        sd = np.sqrt((np.where(known, excess - mean, 0) ** 2).sum(0)) / count
        beyond = (mean > _SURE * sd) & (mean > _LEAST_LINE * line) & (count >= FEWEST_FRAMES)
        seen = beyond.sum(0) >= 3  # quadrants: a glint is in one, at most two
        if not seen.any():
            return None
        k = int(np.argmax(np.where(seen, mean.mean(0), -1)))
        each = excess[:, :, k].mean(1) / line
        share, chance = float(each.mean()), min(1.0, _RATIOS * chance_of(each))
        if chance > FALSE_ALARM or share < _LEAST_LINE:
            return None
        figure = NamedFigure("share", share, float(each.std()) / np.sqrt(len(each)), "of the line")
        radius = NamedFigure("radius", float(np.exp(at[k])), _REACH / _RATIOS, "of the line's")
        return self._mismatch(
            "second_line", "line", figure, chance, "ghost",
            f"A second ring lies at {radius.value:.2f} radii of the line, {100 * share:.0f} % as bright: "
            "a ghost of window or lens, or a second sheet.", (radius,),
        )  # fmt: skip


def _blur_of(own: Float, cross: Float) -> Float:
    """Return half the variances (4,) that a frame is blurred by, without what a displaced photo makes."""
    size = np.linalg.solve(own + 1e-9 * np.trace(own) * np.eye(len(own)), cross)
    (du, dv, dr, dt), blur = size[1:5], size[5:]
    moved = np.array([du**2 + dv**2 + dr**2 + dt**2, du**2 - dv**2, 2 * du * dv, dr**2 - dt**2]) / 2
    return np.asarray(blur - moved)


def _without_gaps(values: Float) -> Float:
    """Return values (N,), those that are NaN interpolated."""
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), known, values[known]) if len(known) else np.zeros(len(values))


def _size_beside_one(value: Float, column: Float) -> Float:
    """Return the size of a column (N,) beside a constant, its level where it is brightest, and χ²'s fall."""
    use, size, c = np.ones(len(value), bool), 0.0, column
    for _ in range(_TRIMMED):  # a second line or a glint is no light on the wall
        c = (column - column[use].mean()) * use
        size = float(c @ (value - value[use].mean())) / max(float(c @ c), 1e-9)
        rest = value - size * column
        away = np.abs(rest - np.median(rest))
        use = away < _SURE * max(1.4826 * float(np.median(away)), _LEAST_SPREAD)
    return np.array([size, float(np.quantile(column, 0.95)), size**2 * float(c @ c)])
