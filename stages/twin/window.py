"""Places of the window or the lens: what is there is named by the law that withheld frames bear out best.

Dirt takes light away, L becomes L (1 − a w); what scatters mixes L with its mean widely around, ⟨L⟩; a drop
shows at Δ from its middle what is at Δ (1 − p (1 − Δ²/R²)). w is a spot of the place's size.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy.stats import t

from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.cells import sigmas
from stages.twin.locate import FALSE_ALARM, ImagePlace
from stages.twin.render import Region, TwinFrame

_POWER_STEP = 0.4
_DROPS = tuple((power, size) for power in (0.6, 1.0, 1.4, 1.8) for size in (1.0, 1.2, 1.4, 1.7, 2.0))
"""Bending and radius, in radii of the place, of the drops that are tried."""
_SPOTS = (0.4, 0.6, 0.8, 1.2, 1.8)
"""1 σ of the spots of dirt and scatter that are tried, in radii of the place."""
_LEAST_REACH_PX = 24.0
"""A place is looked at so far about its middle, or over two radii if that is more."""
_AROUND_PX, _WHOLE, _SURE, _FEWEST_FRAMES = 25.0, 0.7, 3.0, 4
"""1 σ of the mean around; share of a place that must be lit wall; σ by which laws are told apart; frames."""
_STATED = {
    "window_dirt": "dust or dirt on the window or the lens takes away",
    "window_scatter": "something on the window or the lens scatters",
    "droplet": "a drop on the window or the lens bends",
}
_NOT_TOLD = (
    "as far as frames show it; whether the image or the wall is so cannot be told. What to do: record once "
    "more with the probe rolled"
)


@dataclass
class WindowPlace:
    """Sums over compared lit frames at one place: χ² of every law with any size follows from them.

    Attributes
    ----------
    place : ImagePlace
    sums : list of (2, L)
        Of each frame: Σ (recorded − twin)(law − twin)/σ² and Σ (law − twin)²/σ² of dirt, scatter, drops
        of each width.
    square, pixels, frame : list
        Of each frame: Σ (recorded − twin)²/σ², pixels, number.
    """

    place: ImagePlace
    sums: list[Float] = field(default_factory=list)
    square: list[float] = field(default_factory=list)
    pixels: list[int] = field(default_factory=list)
    frame: list[int] = field(default_factory=list)

    def add(self, frame: int, above: Float32, twin: TwinFrame, free: Bool) -> None:
        """Take a lit frame (H, W) whose twin has its exposure; pixels in ``free`` are not clipped."""
        box, v, u = self._box(above.shape)
        level, part = twin.level[box], twin.region[box] == Region.WALL
        away = np.hypot(u - self.place.u_px, v - self.place.v_px)
        inside = away < self._reach_px
        use = inside & part & free[box]
        if use.sum() < _WHOLE * inside.sum():
            return
        filled = np.where(part, level, level[use].mean()).astype(np.float32)
        rest, weight = (above[box] - level)[use], 1 / twin.variance[box][use]
        changes = np.stack([(made - level)[use] for made in self._laws(filled, away, u, v)])
        sums = [(changes * (rest * weight)).sum(1), (changes**2 * weight).sum(1)]
        self.sums.append(np.asarray(np.stack(sums), float))
        self.square.append(float((rest**2 * weight).sum()))
        self.pixels.append(int(use.sum()))
        self.frame.append(frame)

    @property
    def _reach_px(self) -> float:
        return max(2 * self.place.radius_px, _LEAST_REACH_PX)

    def _box(self, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Float32, Float32]:
        reach = int(self._reach_px + 2 * _AROUND_PX)
        rows, columns = (
            slice(max(int(at) - reach, 0), min(int(at) + reach, size))
            for at, size in ((self.place.v_px, shape[0]), (self.place.u_px, shape[1]))
        )
        v, u = np.mgrid[rows, columns].astype(np.float32)
        return (rows, columns), v, u

    def _laws(self, level: Float32, away: Float, u: Float32, v: Float32) -> list[Float32]:
        """Return what dirt and scatter of size 1 and each drop make of grey levels (h, w)."""
        mean = cv2.GaussianBlur(level, (0, 0), _AROUND_PX)
        made: list[Float32] = []
        for other in (np.zeros_like(level), mean):
            for width in _SPOTS:
                spot = np.exp(-0.5 * (away / (width * self.place.radius_px)) ** 2).astype(np.float32)
                made.append(np.asarray(level + spot * (other - level), np.float32))
        for power, size in _DROPS:
            near = 1 - np.minimum((away / (size * self.place.radius_px)) ** 2, 1)
            at = [
                (x - corner + (middle - x) * power * near).astype(np.float32)
                for x, corner, middle in (
                    (u, u[0, 0], self.place.u_px),
                    (v, v[0, 0], self.place.v_px),
                )
            ]
            drop = cv2.remap(level, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
            made.append(np.asarray(drop, np.float32))
        return made

    def judged(self, fixed_to: str) -> Mismatch | None:
        """Return what is at the place; None where other frames fit no better with any law."""
        if len(self.frame) < _FEWEST_FRAMES:
            return None
        sums = np.stack(self.sums)
        tried = {
            "window_dirt": _fall(sums[:, :, : len(_SPOTS)], False),
            "window_scatter": _fall(sums[:, :, len(_SPOTS) : 2 * len(_SPOTS)], False),
            "droplet": _fall(sums[:, :, 2 * len(_SPOTS) :], True),
        }
        name = max(tried, key=lambda n: tried[n][0].sum())
        fall, size, sd = tried[name]
        chance = max(self.place.probability, float(t.sf(sigmas(fall), len(fall) - 1)))
        if chance > FALSE_ALARM or "wall" in fixed_to or ("rows" in fixed_to and "image" not in fixed_to):
            return None
        rivals = [n for n in tried if n != name and sigmas(fall - tried[n][0]) < _SURE]
        return self._mismatch([name, *rivals], fixed_to or "image", fall, (size, sd), chance)

    def _mismatch(
        self, names: list[str], fixed_to: str, fall: Float, size: tuple[float, float], chance: float
    ) -> Mismatch:
        place, name = self.place, names[0]
        where = tuple(
            NamedFigure(n, value, place.radius_px / 2, "px")
            for n, value in (("u_px", place.u_px), ("v_px", place.v_px), ("radius_px", place.radius_px))
        )
        before = sum(self.square) / sum(self.pixels)
        brighter = name == "window_dirt" and size[0] < 0
        figure = NamedFigure("power" if name == "droplet" else "share", *size)
        return Mismatch(
            "" if brighter else " or ".join(names), "intensity", fixed_to, where, (figure,), chance,
            before, before - float(fall.sum()) / sum(self.pixels), self._said(names, size[0], fixed_to),
            Look(self.frame[0], place.u_px, place.v_px, 4 * place.radius_px),
        )  # fmt: skip

    def _said(self, names: list[str], size: float, fixed_to: str) -> str:
        at = f"About ({self.place.u_px:.0f}, {self.place.v_px:.0f})"
        if fixed_to != "image":
            return f"{at} the image differs in all frames, {_NOT_TOLD}."
        if names[0] == "window_dirt" and size < 0:
            return f"{at} the image is {100 * -size:.0f} % brighter in all frames."
        share = "the light" if names[0] == "droplet" else f"{100 * min(size, 1.0):.0f} % of the light"
        others = "".join(f", or {_STATED[n]} it" for n in names[1:])
        return f"{at}, in all frames, {_STATED[names[0]]} {share}{others}."


def _fall(sums: Float, drops: bool) -> tuple[Float, float, float]:
    """Return by how much χ² of each frame (F,) falls, width and size from the others, the size and its 1 σ.

    ``sums`` is (F, 2, L) for laws of L widths, of which the best is taken; the size of ``drops`` is fixed.
    """
    frames, fall = np.arange(len(sums)), np.zeros(len(sums))
    for half in (frames % 2 == 0, frames % 2 == 1):
        k, size = _best(sums[half], drops)
        fall[~half] = 2 * size * sums[~half, 0, k] - size**2 * sums[~half, 1, k]
    k, size = _best(sums, drops)
    if drops:
        return fall, _DROPS[k][0], _POWER_STEP / 2
    left = sums[:, 0, k] - size * sums[:, 1, k]
    return fall, size, float(np.sqrt((left**2).sum())) / max(float(sums[:, 1, k].sum()), 1e-9)


def _best(sums: Float, drops: bool) -> tuple[int, float]:
    """Return which law lets χ² fall most over frames, and its size."""
    cross, own = sums.sum(0)
    sizes = np.ones(len(own)) if drops else cross / np.maximum(own, 1e-9)
    k = int(np.argmax(2 * sizes * cross - sizes**2 * own))
    return k, float(sizes[k])
