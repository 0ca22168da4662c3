"""Places of the window or the lens: each is named by the effect that withheld frames support best.

Dirt takes light away, L becomes L (1 − a w); scatter mixes L with its mean over a wide neighbourhood, ⟨L⟩; a
drop shows at Δ from its middle what is at Δ (1 − p (1 − Δ²/R²)). w is a spot of the place's size.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from scipy.stats import t

from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.cells import sigmas
from stages.twin.locate import FALSE_ALARM, LEAST_CHANGE, ImagePlace
from stages.twin.render import Region, TwinFrame
from stages.twin.spot import PARTS, WIDEST_PX, FittedLaw, brighter_within, fall_of_pattern, fall_of_spot

_POWER_STEP, _ASIDE_PX = 0.4, 0.5
"""Steps of bending that are tried; 1 σ of a displacement, px: blocks of 24 px flatten its peak. Chosen."""
_SURELY = 2.0
"""σ by which a drop's size must exceed 0, and by which texture must be displaced before that alone makes a
drop: radius errors from an unstated tilt of the laser had made two drops of .4 ± .5 px."""
_DROPS = tuple((power, size) for power in (0.6, 1.0, 1.4, 1.8) for size in (1.0, 1.2, 1.4, 1.7, 2.0))
"""Bending and radius, in radii of the place, of the drops that are tried."""
_LARGE_PX = 16.0
"""In larger spots only every second pixel is used: twenty thousand are enough for five numbers."""
_AROUND_PX, _WHOLE, _SURE, _FEWEST_FRAMES = 25.0, 0.7, 3.0, 3
"""1 σ of the wide mean, px; share of a place that must be lit wall; σ by which effects are distinguished;
fewest frames."""
_OF_CONTRAST = 0.15
"""Largest share by which the photo's texture may differ from the frames': half a pixel of blur makes that."""
_BLURS, _AT_LINE = {"motion_blur", "defocus"}, ("window_dirt", "window_scatter")
_STATED = {
    "window_dirt": "dust or dirt on the window or the lens, or what shades it, takes away {}",
    "window_scatter": "something on the window or the lens scatters {}",
    "droplet": "a drop on the window or the lens bends {}",
}


@dataclass
class WindowPlace:
    """Sums over compared lit frames at one place, from which χ² of every effect of any size follows.

    Attributes
    ----------
    place : ImagePlace
    spots : list of (2, 2, h, w)
        Of each frame and pixel (recorded − twin)(effect − twin)/σ² and (effect − twin)²/σ², for dirt and for
        scatter of full size; 0 where a pixel does not count. In a large place every `_step` pixels.
    drops : list of (2, L)
        The same for drops, summed over pixels, of each frame.
    square, pixels, frame : list
        Of each frame: Σ (recorded − twin)²/σ², number of pixels, frame number.
    corner : (2,)
        Column and row of the first pixel of ``spots``.
    aside_px : float
        Largest displacement of texture at the place, from the frames that the run has measured.
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
        """Add a lit frame (H, W) whose twin has its exposure; ``free`` marks pixels that are not clipped.

        ``drawn`` is the twin's level with texture displaced as the measured frames show, used where that is
        certain.
        """
        box, v, u = self._box(above.shape)
        level, part = twin.level[box], twin.region[box] == Region.WALL
        away = np.hypot(u - self.place.u_px, v - self.place.v_px)
        inside = away < self._reach_px
        use = inside & part & free[box]
        must = away < self.place.radius_px
        if use[must].sum() < _WHOLE * must.sum():
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
        """Whether frames show that texture is displaced."""
        return self.aside_px > _SURELY * _ASIDE_PX

    @property
    def _step(self) -> int:
        """Spacing of the pixels that are used in spots: neighbouring pixels of a large place are alike."""
        return max(1, int(self.place.radius_px / _LARGE_PX))

    @property
    def _reach_px(self) -> float:
        return max(min(2 * self.place.radius_px, self.place.radius_px + WIDEST_PX), WIDEST_PX)

    def _box(self, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Float32, Float32]:
        reach = int(self._reach_px + 2 * _AROUND_PX)
        rows, columns = (
            slice(max(int(at) - reach, 0), min(int(at) + reach, size))
            for at, size in ((self.place.v_px, shape[0]), (self.place.u_px, shape[1]))
        )
        v, u = np.mgrid[rows, columns].astype(np.float32)
        return (rows, columns), v, u

    def _drops(self, level: Float32, u: Float32, v: Float32) -> list[Float32]:
        """Return grey levels (h, w) as each drop shows them."""
        away = np.hypot(u - self.place.u_px, v - self.place.v_px)
        made: list[Float32] = []
        for power, size in _DROPS:
            near = 1 - np.minimum((away / (size * self.place.radius_px)) ** 2, 1)
            ways = ((u, self.place.u_px), (v, self.place.v_px))
            at = [(x - x[0, 0] + (middle - x) * power * near).astype(np.float32) for x, middle in ways]
            drop = cv2.remap(level, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
            made.append(np.asarray(drop, np.float32))
        return made

    def judged(self, fixed_to: str, places: int = 1) -> Mismatch | None:
        """Return what is at the place; None where other frames fit no better with any effect.

        All effects are tried at each of ``places``: chance has as many opportunities (Bonferroni, 1936).
        """
        if len(self.frame) < _FEWEST_FRAMES:
            return None
        spots = np.stack(self.spots)
        place = np.array([self.place.u_px, self.place.v_px, self.place.radius_px]) - (*self.corner, 0.0)
        tried = self._tried(spots, place / self._step)
        name, rivals = self._named(tried, spots[:, 0])
        if not name:
            return None
        law, tests = tried[name], len(tried) * places
        chance = min(1.0, max(self.place.probability, tests * law.chance))
        alone = self.bends and name == "droplet" and not rivals
        small = abs(law.size.value) < self._least(name, law.size.sd)
        if chance > FALSE_ALARM or small or ("wall" in fixed_to and not alone):
            return None
        if name == "window_dirt":
            law = replace(law, size=_with_photo(law.size))
        found = self._mismatch([name, *rivals], law, chance)
        if name != "window_scatter":
            return found
        return replace(found, parameters=(law.size, brighter_within(spots[:, 0], place / self._step)))

    def _tried(self, spots: Float32, place: Float) -> dict[str, FittedLaw]:
        u, v, radius = place
        start = np.array([[0.3, u, v, f * radius, 1.0, 0.0] for f in (0.5, 1.5)])
        return {
            "window_dirt": fall_of_spot(spots[:, 0], start, 0.0),
            "window_scatter": fall_of_spot(spots[:, 1], start, _OF_CONTRAST),
            "droplet": _fall_of_drop(np.stack(self.drops), self.aside_px),
        }

    def _named(self, tried: Mapping[str, FittedLaw], dirt: Float32) -> tuple[str, list[str]]:
        """Return the likeliest possible effect, or "", and its rivals: light that stays is no drop."""
        possible = {n: law for n, law in tried.items() if n == "droplet" or law.is_share}
        name, rivals = self._likeliest(possible)
        if name != "droplet" or fall_of_pattern(dirt) <= tried[name].fall.sum():
            return name, rivals
        del possible[name]
        return self._likeliest(possible) if possible else ("", [])

    def _likeliest(self, tried: Mapping[str, FittedLaw]) -> tuple[str, list[str]]:
        """Return the likeliest effect, and those that frames do not distinguish from it.

        Dirt may also lie on a drop, but it displaces nothing: where texture is displaced and frames confirm a
        drop, it is a drop unless another effect fits significantly better, and has no rivals if none fits
        better at all. Something dark may predict a little of a drop's change, and its rim seems to displace
        texture.
        """
        name, drop = max(tried, key=lambda n: tried[n].fall.sum()), tried.get("droplet")
        if drop is not None and self.bends and drop.chance < FALSE_ALARM:
            if name == "droplet":
                return name, []
            beaten = any(sigmas(fit.fall - drop.fall) >= _SURE for fit in tried.values())
            name = name if beaten else "droplet"
        others = [n for n in tried if n != name]
        return name, [n for n in others if sigmas(tried[name].fall - tried[n].fall) < _SURE]

    def _least(self, name: str, sd: float) -> float:
        """Return the smallest size that is reported, from the 1 σ of a size.

        The size of a spot comes from a few parts of the frames: 2 σ occur by chance at one place in twenty,
        and wall that differs in one part of the run does as much. What the photo leaves stays in all frames:
        a spot must be significantly larger.
        """
        if name == "droplet":
            return _SURELY * sd
        parts = min(PARTS, len(self.frame))
        return max(float(t.isf(FALSE_ALARM, parts - 1)) * sd, LEAST_CHANGE + _SURELY * sd)

    def _mismatch(self, names: list[str], law: FittedLaw, chance: float) -> Mismatch:
        place, size = self.place, law.size
        numbers = ("u_px", "v_px", "radius_px")
        where = tuple(NamedFigure(n, getattr(place, n), place.radius_px / 2, "px") for n in numbers)
        before = sum(self.square) / sum(self.pixels)
        # What the photo shows and frames do not is neither dirt nor scatter.
        unlike = names[0] != "droplet" and size.value < 0
        after = before - float(law.fall.sum()) / sum(self.pixels)
        return Mismatch(
            "" if unlike else " or ".join(names), "intensity", "image", where, (size,), chance,
            before, after, self._said(names, size.value),
            Look(self.frame[0], place.u_px, place.v_px, 4 * place.radius_px),
        )  # fmt: skip

    def _said(self, names: list[str], size: float) -> str:
        at, shown = f"About ({self.place.u_px:.0f}, {self.place.v_px:.0f})", len(self.frame)
        when = f"in the {shown} compared frames that could be judged there"
        if names[0] == "window_dirt" and size < 0:
            return f"{at} the image is {100 * -size:.0f} % brighter {when}."
        if names[0] == "window_scatter" and size < 0:
            return f"{at} texture is {100 * -size:.0f} % stronger than in the photo {when}."
        share = "the light" if names[0] == "droplet" else f"{100 * min(size, 1.0):.0f} % of the light"
        share = f"at least {share}" if names[0] == "window_dirt" else share
        others = "".join(f", or {_STATED[n].format('as much')}" for n in names[1:])
        return f"{at}, {when}, {_STATED[names[0]].format(share)}{others}."


def separated_from_blur(
    found: Sequence[Mismatch], whole: Sequence[Mismatch]
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return what remains on the window, and what is withdrawn because whole pictures are blurred.

    Blur makes texture faint everywhere, and most where it is finest: that looks like scatter at some places.
    A blurred line alone says nothing of texture, which frames then show as sharp as the photo does.
    """
    if not any(m.channel != "line" and set(m.names) & _BLURS for m in whole):
        return tuple(found), ()
    unsure = tuple(m for m in found if "window_scatter" in m.names)
    said = "{} But whole frames are blurred, which looks the same here."
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in unsure)
    return tuple(m for m in found if m not in unsure), withdrawn


def or_on_window(found: Sequence[Mismatch]) -> tuple[Mismatch, ...]:
    """Return the findings; a dim sector of the laser may also be dirt or scatter on the window there.

    The wall's photo was made through the same window, mostly where the line is. What lies across the line is
    therefore hidden in it, and lit frames need not show it; scatter takes no light from lit wall at all.
    """
    return tuple(_or_window(m) if "laser_sector" in m.names else m for m in found)


def _or_window(sector: Mismatch) -> Mismatch:
    said = (
        f"{sector.statement} Or something on the window or the lens dims the line there: the wall's photo "
        "was made through it, too, and lit frames need not show it."
    )
    return replace(sector, name=" or ".join((sector.name, *_AT_LINE)), statement=said)


def _with_photo(share: NamedFigure) -> NamedFigure:
    """Return the share s of light that dirt takes, with a σ that includes dirt in the wall's photo.

    The photo was made through the same window. If it is itself darker by h, then 1 − t = (1 − s)(1 − h): dirt
    takes t = s + h (1 − s). h is unknown and is taken to be uniform from 0 to s: the photo contains no more
    than frames show beyond it, since it is a mean of views through other places of the window as well. The
    RMS of t about the reported s is then s (1 − s) / √3. If the photo contains more, t is larger than σ says:
    hence the words "at least".
    """
    known = float(np.clip(share.value, 0.0, 1.0))
    return replace(share, sd=float(np.hypot(share.sd, known * (1 - known) / np.sqrt(3))))


def _fall_of_drop(sums: Float, aside_px: float) -> FittedLaw:
    """Return the drop that fits best; ``sums`` (F, 2, L): drops tried, then the measured displacement."""
    frames, (cross, own) = np.arange(len(sums)), np.moveaxis(sums, 1, 0)
    gain, half = 2 * cross - own, np.arange(len(sums)) % 2
    by_half = np.array([int(np.argmax(gain[half != h].sum(0))) for h in (0, 1)])
    kept = frames, by_half[half]
    fall, shown = gain[kept], cross[kept] / np.maximum(own[kept], 1e-9)
    best = int(np.argmax(gain.sum(0)))
    if best == len(_DROPS):
        return FittedLaw(fall, NamedFigure("aside", aside_px, _ASIDE_PX, "px"), shown)
    return FittedLaw(fall, NamedFigure("power", _DROPS[best][0], _POWER_STEP / 2), shown)
