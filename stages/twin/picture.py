"""Effects on the whole picture: motion blur, stray light, bloom. A second line: `stages.twin.second_ring`.

Every frame gives its own estimate of the size of each effect, by least squares over its pixels or blocks. An
effect on whose size frames agree beyond chance is suspected, and then judged by `stages.twin.gate`. Effects
on texture are fitted together with exposure and a displaced photo, so as not to be confused with these. A
change σ² of the blur's variance along a direction α changes the picture L by σ²/2 · d²L/dα².
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import chance_of, sigmas
from stages.twin.compare import of_blocks
from stages.twin.darkness import level_of_no_wall
from stages.twin.gate import Suspected
from stages.twin.glow import ELSE, LEAST_LEVEL, glow
from stages.twin.locate import FALSE_ALARM
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Scene
from stages.twin.second_ring import ring_profile, second_ring
from stages.twin.stray_light import STRAY_NAMES, brings_light, size_beside_one, stray, stray_lights
from stages.twin.switched import BLOOM_PX, STEP, TILE, bloom, leaked, motion_blur

_SURE, FEWEST_FRAMES = 3.0, 6
"""σ by which effects are distinguished; fewest frames."""
LEAST_BLUR_PX = 0.7
"""Smallest motion blur that is named, 1 σ, px: a sharp lens and a pixel blur as much by themselves."""
_ONE_WAY = 0.6
"""Least directional share of a blur: 1 for motion alone; a quarter of a defocus seems to have a direction."""
OF_LAW = 0.2
"""Relative 1 σ of a blur because its shape is simplified: texture as fine as the blur bends more than its
second derivative says."""
_FINE_PX, _KEPT = 9, 1.0
"""Window, px, against which fine texture is compared, and share of its energy above which nothing is
blurred."""
_DIRECTIONS = ("even", "across", "slanted", "radial")
_CLIPPED, _LEAST_BLOOM, _NEAR = 200, 0.01, 0.02
"""Fewest clipped pixels, and fewest beside them in each part; smallest leak, and smallest spread."""
_ALONG = "along the pipe"
_OBLIQUE = (
    "the photo has its blur as well, but was made where the wall is seen less obliquely. What to do: record "
    "some frames at rest, in which only the lens blurs."
)


@dataclass
class WholePictures:
    """Collects the estimates of effects on the whole picture from single frames; see `suspected`.

    Attributes
    ----------
    scene : Scene
    blur, kept, stray, bloom, ghost : list
        For each frame: own and cross sums of both halves of the picture; share of the fine texture's energy;
        sizes of the `stray_lights`, their levels, falls of χ² and means, and by how much the wall's mean
        above what sees no wall exceeds them; leak along columns and rows in two parts of the picture;
        brightness over ln of the ratio of radii in four quadrants.
    frame : dict of str to list of int
        Frames used for each effect.
    """

    scene: Scene
    blur: list[tuple[Float, Float]] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    stray: list[Float] = field(default_factory=list)
    bloom: list[Float] = field(default_factory=list)
    ghost: list[Float] = field(default_factory=list)
    frame: defaultdict[str, list[int]] = field(default_factory=lambda: defaultdict(list))

    def _mismatch(
        self, name: str, fixed_to: str, size: NamedFigure, chance: float, of: str, said: str
    ) -> Mismatch:
        channel, at = "line" if fixed_to == "line" else "intensity", self.frame[of][0]
        look = self.scene.ring.whole(at)
        return Mismatch(name, channel, fixed_to, (), (size,), chance, np.nan, np.nan, said, look)

    def add_lit(self, frame: int, above: Float32, twin: TwinFrame, free: Bool) -> None:
        """Add a lit frame (H, W) whose twin has its exposure; ``free`` marks pixels that are not clipped."""
        inner = (slice(STEP, -STEP, STEP),) * 2
        use = cv2.erode((free & (twin.region == Region.WALL)).astype(np.uint8), np.ones((5, 5), np.uint8))
        at = np.flatnonzero(use[inner])
        if len(at) < TILE**2:
            return
        columns = self._columns(twin.level, inner).reshape(-1, use[inner].size)[:, at]
        weight = np.asarray(1 / np.sqrt(twin.variance[inner].ravel()[at]), np.float32)
        columns, rest = columns * weight, (above - twin.level)[inner].ravel()[at] * weight
        row, column = np.unravel_index(at, use[inner].shape)
        half = (row // TILE + column // TILE) % 2
        sums = [(c @ c.T, c @ rest[half == h]) for h in (0, 1) for c in [columns[:, half == h]]]
        self.blur.append((np.stack([s[0] for s in sums]).astype(float), np.stack([s[1] for s in sums])))
        fine = [(a - cv2.blur(a, (_FINE_PX, _FINE_PX)))[inner].ravel()[at] for a in (above, twin.level)]
        self.kept.append(float((fine[0] ** 2).sum() / max(float((fine[1] ** 2).sum()), 1e-9)))
        self.frame["blur"].append(frame)

    def _columns(self, level: Float32, inner: tuple[slice, slice]) -> Float32:
        """Return columns for exposure and displacements, then for blurs in `_DIRECTIONS`."""

        def at(down: int, right: int) -> Float32:
            both = zip((down, right), level.shape, strict=True)
            return np.asarray(level[tuple(slice(STEP + d, n - STEP + d, STEP) for d, n in both)])

        here, phi = at(0, 0), self.scene.polar[1][inner]
        du, dv = (at(0, 1) - at(0, -1)) / 2, (at(1, 0) - at(-1, 0)) / 2
        uu, vv = at(0, 1) + at(0, -1) - 2 * here, at(1, 0) + at(-1, 0) - 2 * here
        uv = (at(1, 1) + at(-1, -1) - at(1, -1) - at(-1, 1)) / 4
        c, s = np.cos(phi), np.sin(phi)
        even, across = (uu + vv) / 2, (uu - vv) / 2
        radial = across * (c**2 - s**2) + uv * (2 * c * s)
        return np.stack([here, du, dv, c * du + s * dv, c * dv - s * du, even, across, uv, radial])

    def add_laser(self, frame: int, above: Float32, twin: TwinFrame, free: Bool, lit: TwinFrame) -> None:
        """Add a frame of the laser alone, with the twin of a lit frame from the same pose."""
        line = (twin.region == Region.LINE_CORE) | (twin.region == Region.LINE_FLANK)
        away = cv2.dilate(line.astype(np.uint8), np.ones((9, 9), np.uint8)) == 0
        known = away & (lit.region == Region.WALL) & free
        lights = stray_lights(self.scene, twin, lit)
        small = [of_blocks(np.where(known, a, 0)) for a in (np.ones_like(above), above, *lights)]
        # 0.99: whole blocks only, up to rounding.
        whole = small[0] > 0.99
        if whole.sum() < TILE**2:
            return
        value, *columns = (a[whole].astype(float) for a in small[1:])
        sizes = np.array([size_beside_one(value, c) for c in columns])
        if self.scene.outside is None:
            sizes[:, -1] = np.nan
        else:
            sizes[:, -1] -= level_of_no_wall(above, free & (twin.region != Region.EDGE) & self.scene.outside)
        self.stray.append(sizes)
        self.frame["stray"].append(frame)
        around = ring_profile(self.scene.ring, above, twin, free & (twin.region != Region.EDGE))
        if around is not None:
            self.ghost.append(around)
            self.frame["ghost"].append(frame)

    def add_clipped(self, frame: int, above: Float32, twin: TwinFrame, free: Bool) -> None:
        """Add any frame: what leaks from clipped pixels along columns, and along rows for comparison.

        Not on the line: errors of its profile beside clipped pixels are larger than what leaks. Wet streaks
        along the pipe shine above and below clipped pixels, too, but only where they are steep in the
        picture: parts of it where the pipe runs more up or more across are examined separately.
        """
        if (~free).sum() < _CLIPPED:
            return
        spread, steep = leaked(free), np.abs(np.tan(self.scene.polar[1])) > 1
        near = free & np.isin(twin.region, (Region.DARK, Region.WALL)) & (spread[0] + spread[1] > _NEAR)
        parts = [near & steep, near & ~steep]
        if min(int(p.sum()) for p in parts) < _CLIPPED:
            return
        each = []
        for part in parts:
            columns = np.stack([*(s[part] for s in spread), twin.level[part]]).astype(float)
            own = columns @ columns.T + 1e-6 * np.eye(3)
            each.append(np.linalg.solve(own, columns @ (above - twin.level)[part].astype(float))[:2])
        self.bloom.append(np.array(each))
        self.frame["bloom"].append(frame)

    def suspected(self, sharpness: Float) -> tuple[Suspected, ...]:
        """Return effects on which frames agree; ``sharpness`` (Z,) is their blur beyond the photo's."""
        made = (
            self._motion_blur(sharpness),
            self._stray() or glow(self.stray, self.frames_of("stray"), self.scene.ring),
            self._bloom(),
            second_ring(self.scene.ring, self.ghost, self.frames_of("ghost")),
        )
        return tuple(m for m in made if m is not None)

    def frames_of(self, law: str) -> Int:
        """Return the frames (F,) in which an effect was estimated."""
        return np.array(self.frame[law], np.int64)

    def direction(self, frame: int) -> Float:
        """Return cosine and sine of twice the direction of a frame's blur, from each half (2, 2)."""
        if frame not in self.frame["blur"]:
            return np.tile([1.0, 0.0], (2, 1))
        own, cross = self.blur[self.frame["blur"].index(frame)]
        return np.array([_blur_of(o, c)[1:3] for o, c in zip(own, cross, strict=True)])

    def _blurs(self) -> Float:
        """Half the variances (F, 2, 4), px², of the frames' blur, from both halves of the picture."""
        each = [[_blur_of(o, c) for o, c in zip(*frame, strict=True)] for frame in self.blur]
        return np.array(each).reshape(-1, 2, len(_DIRECTIONS))

    @property
    def loses_texture(self) -> bool:
        """Whether fine texture is fainter than in the photo: a displaced photo only moves it."""
        return bool(self.kept) and float(np.mean(self.kept)) < _KEPT

    def even_blur(self, sharpness: Float) -> Float:
        """Return half the variance (F,), px², of lit frames' isotropic blur beyond that of the photo."""
        return np.asarray(self._blurs()[:, :, 0].mean(1) + np.mean(sharpness))

    def _motion_blur(self, sharpness: Float) -> Suspected | None:
        if len(self.blur) < FEWEST_FRAMES:
            return None
        each = self._blurs()
        uniform = (each[:, 0, 1:3] * each[:, 1, 1:3]).sum(1)
        radial = np.maximum(each[:, :, 3].mean(1), 0) ** 2 * np.sign(each[:, :, 3].mean(1))
        ways = ((uniform, "sideways"), (radial, _ALONG))
        product, way = max(ways, key=lambda p: float(p[0].mean()))
        size = _blur_px(product.mean())
        chance = chance_of(product)
        if size**2 / 2 < _ONE_WAY * self.even_blur(sharpness).mean():
            return None  # isotropic blur, on texture that is finer in one direction
        if not self.loses_texture or size < LEAST_BLUR_PX or chance > FALSE_ALARM or sigmas(product) < _SURE:
            return None
        spread = float(product.std() / np.sqrt(len(product))) / max(float(product.mean()), 1e-12) / 4
        sd = size * float(np.hypot(spread, OF_LAW))
        found = self._mismatch(
            "motion_blur", "time", NamedFigure("blur", size, sd, "px"), chance, "blur",
            f"Frames are blurred by {size:.1f} px (1 σ) {way}, and less across: they move during exposure.",
        )  # fmt: skip
        sizes, along = product[:, None], float(way == _ALONG)
        if along:
            said = f"{found.statement[:-1]}, or the lens is out of focus: {_OBLIQUE}"
            found = replace(found, name="defocus or motion_blur", statement=said)
        return Suspected(
            found, motion_blur, self.frames_of("blur"), sizes, lambda m: np.array([_blur_px(m[0]), along])
        )

    def _stray(self) -> Suspected | None:
        if len(self.stray) < FEWEST_FRAMES:
            return None
        size, level, fall, mean, more = np.moveaxis(np.stack(self.stray), -1, 0)
        k = int(np.argmax(fall.sum(0)))
        # The best of several laws looks more significant by chance than a single one.
        chance, share = min(len(STRAY_NAMES) * chance_of(size[:, k]), 1.0), float(size[:, k].mean())
        if chance > FALSE_ALARM or share * level[:, k].mean() < LEAST_LEVEL:
            return None
        if not brings_light(k, mean[:, k], more[:, k]):
            return None
        others = [j for j, name in enumerate(STRAY_NAMES) if name != STRAY_NAMES[k]]
        rivals = [STRAY_NAMES[j] for j in others if sigmas(fall[:, k] - fall[:, j]) < _SURE]
        name, grey = " or ".join(sorted({STRAY_NAMES[k], *rivals})), share * level[:, k]
        sd = float(np.std(size[:, k])) / np.sqrt(len(size)) * float(level[:, k].mean())
        found = self._mismatch(
            name, "wall", NamedFigure("level", float(grey.mean()), sd, "grey levels"), chance, "stray",
            f"With the LEDs off, wall away from the line has up to {grey.mean():.1f} grey levels: "
            f"other light, {ELSE}.",
        )  # fmt: skip
        return Suspected(found, stray(k), self.frames_of("stray"), size)

    def _bloom(self) -> Suspected | None:
        if len(self.bloom) < FEWEST_FRAMES:
            return None
        leak = np.stack(self.bloom) / 255.0
        more = (leak[..., 0] - leak[..., 1]).T
        size, chance = float(more.mean()), max(map(chance_of, more))
        if chance > FALSE_ALARM or min(map(sigmas, more)) < _SURE or size < _LEAST_BLOOM:
            return None
        found = self._mismatch(
            "bloom", "image", NamedFigure("leak", size, np.inf, "of full scale"), chance, "bloom",
            "Above and below clipped pixels the picture is brighter than beside them: charge leaks along "
            f"columns. If it fades to 1/e over {BLOOM_PX:.0f} px, about {100 * size:.0f} % of full scale "
            "leaks from each in all; how far it reaches is not measured, and with it the share is uncertain.",
        )  # fmt: skip
        return Suspected(found, bloom, self.frames_of("bloom"), 255.0 * leak.mean(1))


def _blur_px(product: float) -> float:
    """Return the blur, 1 σ, px, from the product of its half variances in two halves of a picture."""
    return float(np.sqrt(2 * np.sqrt(max(product, 0.0))))


def _blur_of(own: Float, cross: Float) -> Float:
    """Return half the variances (4,), px², of a frame's blur, corrected for a displaced photo."""
    size = np.linalg.solve(own + 1e-9 * np.trace(own) * np.eye(len(own)), cross)
    (du, dv, dr, dt), blur = size[1:5], size[5:]
    moved = np.array([du**2 + dv**2 + dr**2 + dt**2, du**2 - dv**2, 2 * du * dv, dr**2 - dt**2]) / 2
    return np.asarray(blur - moved)
