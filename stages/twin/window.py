"""Places of the window or the lens: what is there is named by the law that withheld frames bear out best.

Dirt takes light away, L becomes L (1 − a w); what scatters mixes L with its mean widely around, ⟨L⟩; a drop
shows at Δ from its middle what is at Δ (1 − p (1 − Δ²/R²)). w is a spot of the place's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.cells import sigmas
from stages.twin.locate import FALSE_ALARM, ImagePlace
from stages.twin.render import Region, TwinFrame

_POWER_STEP, _ASIDE_PX = 0.4, 0.5
"""Steps of bending that are tried; 1 σ of a displacement, since blocks of 24 px blunt its peak. Chosen."""
_SURELY_ASIDE = 2.0
"""σ by which texture must be drawn aside before that alone makes a drop: radii that err by an unstated
tilt of the laser had made two drops of .4 ± .5 px."""
_DROPS = tuple((power, size) for power in (0.6, 1.0, 1.4, 1.8) for size in (1.0, 1.2, 1.4, 1.7, 2.0))
"""Bending and radius, in radii of the place, of the drops that are tried."""
_LEAST_REACH_PX = 48.0
"""A place is looked at so far about its middle, or over two radii or this far beyond it if that is more."""
_LARGE_PX = 16.0
"""Of spots twice as large every second pixel is looked at: twenty thousand are enough for five numbers."""
_AROUND_PX, _WHOLE, _SURE, _FEWEST_FRAMES = 25.0, 0.7, 3.0, 3
"""1 σ of the mean around; share of a place that must be lit wall; σ by which laws are told apart; frames."""
_FLATNESS = (0.7, 5.0)
"""Bounds of a spot's flatness: 1 is Gaussian, 2 has a flat middle and a steep rim, 5 is a disc."""
_OF_CONTRAST = 0.15
"""Most by which the photo has more or less texture than frames: half a pixel of blur does as much."""
_OF_LIGHT = 0.005
"""1 σ of a share of the light for want of knowing the light about the spot: half of a photo's error."""
_LEAST_WIDTH_PX, _MIDDLE = 2.0, 0.25
"""Narrowest spot, 1 σ; the middle of a spot reaches to where a quarter of its depth is gone."""
_PARTS = 6
"""Parts of the frames of which each is left out once, for the σ of a spot: neighbours in time go together."""
_BLURS = ("motion_blur", "defocus")
_STATED = {
    "window_dirt": "dust or dirt on the window or the lens takes away",
    "window_scatter": "something on the window or the lens scatters",
    "droplet": "a drop on the window or the lens bends",
}
_NOT_TOLD = (
    "as far as frames show it; whether the image or the wall is so cannot be told. What to do: record once "
    "more with the probe rolled"
)


@dataclass(frozen=True)
class _Fitted:
    """A law's size, and by how much χ² of frames (F,) falls with the size that other frames tell."""

    fall: Float
    size: NamedFigure

    @property
    def chance(self) -> float:
        return float(t.sf(sigmas(self.fall), len(self.fall) - 1))


@dataclass
class WindowPlace:
    """Sums over compared lit frames at one place: χ² of every law with any size follows from them.

    Attributes
    ----------
    place : ImagePlace
    spots : list of (2, 2, h, w)
        Of each frame and pixel (recorded − twin)(law − twin)/σ² and (law − twin)²/σ² of dirt and of scatter
        that takes or mixes all light; 0 where a pixel does not count. Of a large place every `_step` pixels.
    drops : list of (2, L)
        Of each frame the same of drops, summed over pixels.
    square, pixels, frame : list
        Of each frame: Σ (recorded − twin)²/σ², pixels, number.
    corner : (2,)
        Column and row of the first pixel of ``spots``.
    aside_px : float
        By how much texture is drawn aside at most, as frames beside the compared ones tell.
    """

    place: ImagePlace
    spots: list[Float32] = field(default_factory=list)
    drops: list[Float] = field(default_factory=list)
    square: list[float] = field(default_factory=list)
    pixels: list[int] = field(default_factory=list)
    frame: list[int] = field(default_factory=list)
    corner: tuple[float, float] = (0.0, 0.0)
    aside_px: float = 0.0

    def add(
        self, frame: int, above: Float32, twin: TwinFrame, free: Bool, drawn: Float32 | None = None
    ) -> None:
        """Take a lit frame (H, W) whose twin has its exposure; pixels in ``free`` are not clipped.

        ``drawn`` is the twin's level with texture drawn aside as other frames tell, used where that is sure.
        """
        box, v, u = self._box(above.shape)
        level, part = twin.level[box], twin.region[box] == Region.WALL
        away = np.hypot(u - self.place.u_px, v - self.place.v_px)
        inside = away < self._reach_px
        use = inside & part & free[box]
        if use.sum() < _WHOLE * inside.sum():
            return
        filled = np.where(part, level, level[use].mean()).astype(np.float32)
        rest, weight = above[box] - level, np.where(use, 1 / twin.variance[box], np.float32(0))
        whole = np.stack([-level, cv2.GaussianBlur(filled, (0, 0), _AROUND_PX) - level])
        ends = [np.flatnonzero(inside.any(axis))[[0, -1]] for axis in (1, 0)]
        near = [slice(first, last + 1, self._step) for first, last in ends]
        self.corner = float(u[0, near[1].start]), float(v[near[0].start, 0])
        weight_of = weight * np.float32(self._step**2)
        spots = np.stack([whole * (rest * weight_of), whole**2 * weight_of], 1)
        self.spots.append(spots[..., near[0], near[1]])
        rest, weight = rest[use], weight[use]
        drops = self._drops(filled, u, v) + ([drawn[box]] if drawn is not None and self.bends else [])
        changes = np.stack([(made - level)[use] for made in drops])
        sums = [(changes * (rest * weight)).sum(1), (changes**2 * weight).sum(1)]
        self.drops.append(np.asarray(np.stack(sums), float))
        self.square.append(float((rest**2 * weight).sum()))
        self.pixels.append(int(use.sum()))
        self.frame.append(frame)

    @property
    def bends(self) -> bool:
        """Whether frames tell that texture is drawn aside."""
        return self.aside_px > _SURELY_ASIDE * _ASIDE_PX

    @property
    def _step(self) -> int:
        """Every how many pixels spots are looked at: those of a large place are alike."""
        return max(1, int(self.place.radius_px / _LARGE_PX))

    @property
    def _reach_px(self) -> float:
        return max(min(2 * self.place.radius_px, self.place.radius_px + _LEAST_REACH_PX), _LEAST_REACH_PX)

    def _box(self, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Float32, Float32]:
        reach = int(self._reach_px + 2 * _AROUND_PX)
        rows, columns = (
            slice(max(int(at) - reach, 0), min(int(at) + reach, size))
            for at, size in ((self.place.v_px, shape[0]), (self.place.u_px, shape[1]))
        )
        v, u = np.mgrid[rows, columns].astype(np.float32)
        return (rows, columns), v, u

    def _drops(self, level: Float32, u: Float32, v: Float32) -> list[Float32]:
        """Return what each drop makes of grey levels (h, w)."""
        away = np.hypot(u - self.place.u_px, v - self.place.v_px)
        made: list[Float32] = []
        for power, size in _DROPS:
            near = 1 - np.minimum((away / (size * self.place.radius_px)) ** 2, 1)
            ways = ((u, self.place.u_px), (v, self.place.v_px))
            at = [(x - x[0, 0] + (middle - x) * power * near).astype(np.float32) for x, middle in ways]
            drop = cv2.remap(level, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
            made.append(np.asarray(drop, np.float32))
        return made

    def judged(self, fixed_to: str) -> Mismatch | None:
        """Return what is at the place; None where other frames fit no better with any law."""
        if len(self.frame) < _FEWEST_FRAMES:
            return None
        spots = np.stack(self.spots)
        place = np.array([self.place.u_px, self.place.v_px, self.place.radius_px]) - (*self.corner, 0.0)
        u, v, radius = place / self._step
        start = np.array([[0.3, u, v, f * radius, 1.0, 0.0] for f in (0.5, 1.5)])
        tried = {
            "window_dirt": _fall_of_spot(spots[:, 0], start, 0.0),
            "window_scatter": _fall_of_spot(spots[:, 1], start, _OF_CONTRAST),
            "droplet": _fall_of_drop(np.stack(self.drops), self.aside_px),
        }
        bends = self.bends and tried["droplet"].chance < FALSE_ALARM
        # Dirt may lie there, too, but draws nothing aside.
        name = "droplet" if bends else max(tried, key=lambda n: tried[n].fall.sum())
        fixed_to = "image" if bends else fixed_to
        chance = max(self.place.probability, tried[name].chance)
        if chance > FALSE_ALARM or "wall" in fixed_to or ("rows" in fixed_to and "image" not in fixed_to):
            return None
        more = {n: sigmas(tried[name].fall - fit.fall) for n, fit in tried.items() if n != name}
        rivals = [n for n, by in more.items() if by < _SURE and not bends]
        law = tried[name]
        if name == "window_dirt":
            law = replace(law, size=_with_photo(law.size))
        return self._mismatch([name, *rivals], fixed_to or "image", law, chance)

    def _mismatch(self, names: list[str], fixed_to: str, law: _Fitted, chance: float) -> Mismatch:
        place, size = self.place, law.size
        numbers = ("u_px", "v_px", "radius_px")
        where = tuple(NamedFigure(n, getattr(place, n), place.radius_px / 2, "px") for n in numbers)
        before = sum(self.square) / sum(self.pixels)
        brighter = names[0] == "window_dirt" and size.value < 0
        after = before - float(law.fall.sum()) / sum(self.pixels)
        return Mismatch(
            "" if brighter else " or ".join(names), "intensity", fixed_to, where, (size,), chance,
            before, after, self._said(names, size.value, fixed_to),
            Look(self.frame[0], place.u_px, place.v_px, 4 * place.radius_px),
        )  # fmt: skip

    def _said(self, names: list[str], size: float, fixed_to: str) -> str:
        at = f"About ({self.place.u_px:.0f}, {self.place.v_px:.0f})"
        if fixed_to != "image":
            return f"{at} the image differs in all frames, {_NOT_TOLD}."
        if names[0] == "window_dirt" and size < 0:
            return f"{at} the image is {100 * -size:.0f} % brighter in all frames."
        share = "the light" if names[0] == "droplet" else f"{100 * min(size, 1.0):.0f} % of the light"
        share = f"at least {share}" if names[0] == "window_dirt" else share
        others = "".join(f", or {_STATED[n]} it" for n in names[1:])
        return f"{at}, in all frames, {_STATED[names[0]]} {share}{others}."


def beside_blur(
    found: Sequence[Mismatch], whole: Sequence[Mismatch]
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return what stands on the window, and what a blur of whole pictures, if one is named, resembles.

    Blur makes texture faint everywhere, and more so where it is finest: that looks like scatter in places.
    """
    if not any(m.name in _BLURS for m in whole):
        return tuple(found), ()
    unsure = tuple(m for m in found if "window_scatter" in m.name.split(" or "))
    said = "{} But whole frames are blurred, which looks alike: it cannot be told."
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in unsure)
    return tuple(m for m in found if m not in unsure), withdrawn


def _with_photo(share: NamedFigure) -> NamedFigure:
    """Return the share s of light that dirt takes, with the σ of what of the dirt may be in the wall's photo.

    The photo was made through the same window. It may hold nothing of the dirt, or as much as makes twin and
    recording alike: a part f of it, uniform from 0 to 1, whose σ is 1 / √12, moves the share by s (1 − s).
    """
    sd = float(np.hypot(share.sd, share.value * (1 - share.value) / np.sqrt(12)))
    return replace(share, sd=sd)


def _fall_of_drop(sums: Float, aside_px: float) -> _Fitted:
    """Return the drop that fits best; ``sums`` (F, 2, L) are of those tried, then of what frames tell."""
    frames, fall = np.arange(len(sums)), np.zeros(len(sums))
    gain = 2 * sums[:, 0] - sums[:, 1]
    for half in (frames % 2 == 0, frames % 2 == 1):
        fall[~half] = gain[~half, int(np.argmax(gain[half].sum(0)))]
    best = int(np.argmax(gain.sum(0)))
    if best == len(_DROPS):
        return _Fitted(fall, NamedFigure("aside", aside_px, _ASIDE_PX, "px"))
    return _Fitted(fall, NamedFigure("power", _DROPS[best][0], _POWER_STEP / 2))


def _fall_of_spot(sums: Float32, start: Float, beyond: float) -> _Fitted:
    """Return the spot that fits best, its depth as its size.

    ``sums`` is (F, 2, h, w); ``start`` (K, 6) holds spots that the search starts from. Beside the spot the
    law may act by up to ``beyond``, as where the photo has less texture: the spot's depth is relative to it.
    The σ holds what leaving out parts of the frames changes, and by how much the spot's middle differs from
    the fitted shape.
    """
    frames, fall = np.arange(len(sums)), np.zeros(len(sums))
    whole = sums.sum(0)
    best = _fitted_spot(whole, start, beyond)
    for half in (frames % 2 == 0, frames % 2 == 1):
        shape = _spot(_fitted_spot(sums[half].sum(0), best[None], beyond), sums.shape[2:])
        fall[~half] = (2 * shape * sums[~half, 0] - shape**2 * sums[~half, 1]).sum((1, 2))
    parts = np.array_split(frames, min(_PARTS, len(frames)))
    fits = np.array([_fitted_spot(whole - sums[p].sum(0), best[None], beyond) for p in parts])
    without = fits[:, 0] / (1 - fits[:, 5])
    spread = (len(parts) - 1) / len(parts) * float(((without - without.mean()) ** 2).sum())
    shape = _spot(best, sums.shape[2:])
    inside = (shape - best[5]) / (best[0] or 1e-9)
    middle = np.exp(-0.5 * ((1 - inside) / _MIDDLE) ** 2)
    weight = max(float((middle * whole[1]).sum()), 1e-9)
    off = float((middle * (whole[0] - shape * whole[1])).sum()) / weight
    sd = float(np.sqrt(spread + off**2 + _OF_LIGHT**2))
    return _Fitted(fall, NamedFigure("share", float(best[0] / (1 - best[5])), sd))


def _spot(place: Float, shape: tuple[int, ...]) -> Float:
    """Return a spot (h, w): d exp(−½ (r²/w²)^q) + b about a column and row, depth d, width w, flatness q."""
    return _spot_at(place, *np.mgrid[: shape[0], : shape[1]][::-1])


def _spot_at(place: Float, u: Int, v: Int) -> Float:
    depth, at_u, at_v, width, flat, beside = place
    square = ((u - at_u) ** 2 + (v - at_v) ** 2) / width**2
    return np.asarray(depth * np.exp(-0.5 * square**flat) + beside)


def _fitted_spot(sums: Float32, start: Float, beyond: float) -> Float:
    """Return depth, column, row, width, flatness and rest of the spot that fits; ``sums`` is (2, h, w)."""
    rows, columns = np.nonzero(sums[1] > 0)
    weight = np.sqrt(sums[1][rows, columns].astype(float))
    value = sums[0][rows, columns] / weight

    def rest(p: Float) -> Float:
        return np.asarray(_spot_at(p, columns, rows) * weight - value)

    reach = start[:, 3].max()
    widest, beside = 2 * max(reach, _LEAST_REACH_PX), beyond + 1e-6
    low = np.array([-3.0, *(start[0, 1:3] - reach), _LEAST_WIDTH_PX, _FLATNESS[0], -beside])
    high = np.array([3.0, *(start[0, 1:3] + reach), widest, _FLATNESS[1], beside])
    begin = np.clip(start, low + 1e-3 * (high - low), high - 1e-3 * (high - low))
    made = [least_squares(rest, s, bounds=(low, high), x_scale=[0.1, 1, 1, 3, 0.3, 0.1]) for s in begin]
    return np.asarray(min(made, key=lambda r: r.cost).x)
