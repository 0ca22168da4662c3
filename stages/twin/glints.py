"""Find spots far brighter than predicted: glints of lamps or laser on bare, wet or raised wall.

No law predicts where a facet of the wall mirrors a lamp, but recurring spots show it. A place where half of
the frames are too bright must be so in the other half, too, including frames without a spot there; otherwise
nothing is named. Spots that do not recur are counted, without a name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy.stats import binom, t

from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from pipeline.recording.base import Illumination
from stages.twin.cells import half_turn, sigmas
from stages.twin.compare import BLOCK_PX, of_blocks
from stages.twin.discs import Disc, disc_of, meet
from stages.twin.locate import FALSE_ALARM
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring

_LEAST_GREY, _LEAST_SIGMA = 40.0, 8.0
"""Grey levels, and σ, by which each pixel of a spot exceeds its twin. Chosen: a photo displaced by its own σ
makes a tenth of that."""
_PIXELS = (20, 12_000)
"""Fewest and most pixels of a spot: noise makes no smaller one as bright, and anything larger is not a
spot."""
MOST_OF_VIEW = 0.05
"""Share of too bright pixels in a frame above which they are not spots: then light or response differ."""
_REACH_PX, _MORE, _FEWEST, _SURE = 16.0, 2, 3, 3.0
"""Spots closer than this, px, are at one place: a glint wanders by some pixels as the probe swings. By how
many frames spots must recur more often on the wall than in the image, or less often, to decide to which they
are fixed; fewest frames; σ by which other frames must confirm it."""

_BESIDE_PX, _ORDINARY, _OF_EXCESS = 8, 0.75, 0.5
"""Least reach, px, of what is around a spot; quantile of the brightness there that is ordinary wall, although
up to three quarters may lie in a shade; share of its excess by which a spot must be brighter. Chosen."""
_PALEST = 2.0
"""Brightness of the palest wall over the 95 % quantile of the wall; chosen."""
_OR_DROP = ", or a drop on the window bends light of the line there"
"""A drop that lit wall does not reveal by its displacement may still show in the dark beside the line."""


@dataclass(frozen=True)
class Spot:
    """A spot in one frame: place in the image and on the wall (px, at the ring), radius, and excess."""

    frame: int
    image: tuple[float, float]
    wall: tuple[float, float]
    radius_px: float
    grey: float

    def at(self, order: str) -> tuple[float, float]:
        """Return its place in the image or on the wall, px."""
        return self.wall if order == "wall" else self.image


@dataclass
class SpotsOfFrames:
    """Collects the spots of compared frames of one light, and the excess brightness of blocks.

    Attributes
    ----------
    light : Illumination
    ring : Ring
    outside : (H, W) bool, optional
        Pixels outside the camera's view, which show no wall, such as a margin with burnt-in text.
    frame, spots : list
    excess : list of (h, w) float32
        Recorded minus predicted brightness of the blocks of each frame, grey levels; NaN where a block is not
        compared entirely.
    variance : list of (h, w) float32
        Variance of single pixels.
    wall : list of (2, h, w) float32
        Place of each block on the wall, px at the ring.
    """

    light: Illumination
    ring: Ring
    outside: Bool | None = None
    frame: list[int] = field(default_factory=list)
    spots: list[Spot] = field(default_factory=list)
    excess: list[Float32] = field(default_factory=list)
    variance: list[Float32] = field(default_factory=list)
    wall: list[Float32] = field(default_factory=list)

    def add(self, frame: int, above: Float32, twin: TwinFrame) -> None:
        """Add a frame (H, W) of grey levels above black; its twin has the frame's exposure."""
        known = twin.region == (Region.DARK if self.light == Illumination.LASER else Region.WALL)
        known = known if self.outside is None else known & ~self.outside
        more = np.where(known, above - twin.level, np.float32(0))
        beyond = (more > _LEAST_GREY) & (more * more > np.float32(_LEAST_SIGMA**2) * twin.variance)
        self.frame.append(frame)
        # 0.99: whole blocks only, up to rounding.
        self.excess.append(np.where(of_blocks(known) > 0.99, of_blocks(more), np.float32(np.nan)))
        self.variance.append(of_blocks(twin.variance))
        shape, middle = self.excess[-1].shape, (slice(BLOCK_PX // 2, None, BLOCK_PX),) * 2
        wall = [a[middle][: shape[0], : shape[1]] for a in (twin.distance_mm, twin.azimuth_rad)]
        self.wall.append(np.stack(self._on_wall(*wall)))
        if beyond.any() and beyond.sum() < MOST_OF_VIEW * known.sum():
            self.spots += self._spots(frame, beyond, more, known, twin)

    def _on_wall(self, distance_mm: Float32, azimuth_rad: Float32) -> tuple[Float32, Float32]:
        scale = np.float32(self.ring.radius_px / self.ring.radius_mm)
        return distance_mm * scale, np.mod(azimuth_rad, np.float32(2 * np.pi)) * np.float32(
            self.ring.radius_px
        )

    def _spots(self, frame: int, beyond: Bool, more: Float32, known: Bool, twin: TwinFrame) -> list[Spot]:
        joined = cv2.morphologyEx(beyond.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        count, label, stats, centre = cv2.connectedComponentsWithStats(joined)
        line = np.isin(twin.region, (Region.LINE_CORE, Region.LINE_FLANK)).astype(np.uint8)
        # What touches the line is the line itself: displaced where the wall is elsewhere, or wide where it
        # clips.
        of_line = set(np.unique(label[cv2.dilate(line, np.ones((3, 3), np.uint8)) > 0]).tolist())
        found, recorded = [], twin.level + more
        for k in sorted(set(range(1, count)) - of_line):
            left, top, width, height, area = (int(x) for x in stats[k])
            if not _PIXELS[0] <= area <= _PIXELS[1]:
                continue
            box, at = (slice(top, top + height), slice(left, left + width)), centre[k].astype(int)[::-1]
            wide = _about(box)
            grey = float(more[box][label[box] == k].mean())
            if not _stands_out(label[wide] == k, grey, recorded[wide], known[wide]):
                continue
            wall = self._on_wall(twin.distance_mm[tuple(at)], twin.azimuth_rad[tuple(at)])
            image = float(centre[k][0]), float(centre[k][1])
            place, radius = (float(wall[0]), float(wall[1])), float(np.sqrt(area / np.pi))
            found.append(Spot(frame, image, place, radius, grey))
        return found

    def found(self, lit_wall: float = 0.0, bent: Sequence[Mismatch] = ()) -> tuple[Mismatch, ...]:
        """Return the places where spots recur, and a count of the other spots.

        ``lit_wall`` is the brightness, in grey levels, that other light gives to wall that is dark in the
        twin: a spot not far brighter than that is the palest wall. Spots at places of the image where light
        is ``bent`` are wall from elsewhere.
        """
        places, left = list[Mismatch](), [s for s in self.spots if s.grey > _PALEST * lit_wall]
        discs = [d for d in map(disc_of, bent) if d is not None]
        left = [s for s in left if not any(d.touches(Disc(*s.image, s.radius_px)) for d in discs)]
        while left:
            tried = {order: _largest_group(left, order) for order in ("image", "wall")}
            count = {order: _frames_of(group) for order, group in tried.items()}
            order = max(count, key=lambda o: count[o])
            if count[order] < _FEWEST or self._chance(count[order]) > FALSE_ALARM:
                break
            alike = abs(count["image"] - count["wall"]) < _MORE
            place = self._at_one_place(tried[order], order, "image or wall" if alike else order)
            places += [] if place is None else [place]
            left = [s for s in left if s not in tried[order]]
        return (*places, *self._others(left))

    def _chance(self, frames: int) -> float:
        """Return the probability that randomly scattered spots fall on one place in so many frames."""
        view = float(np.isfinite(self.excess[0]).sum()) * BLOCK_PX**2
        each = min(1.0, len(self.spots) / len(self.frame) * np.pi * _REACH_PX**2 / max(view, 1.0))
        return float(min(1.0, 2 * len(self.spots) * binom.sf(frames - 2, len(self.frame) - 1, each)))

    def _at_one_place(self, group: list[Spot], order: str, fixed_to: str) -> Mismatch | None:
        """Return what recurs at a group's place; None where other frames are not brighter there."""
        middle = np.median([s.at(order) for s in group], 0)
        spread = float(np.std([s.at(order) for s in group], 0).max())
        radius = float(np.median([s.radius_px for s in group]))
        value, variance = self._brightness(middle, radius, order)
        half = np.arange(len(value)) % 2
        if len(value) < 2 * _FEWEST - 2:
            return None
        other = np.where(half == 0, value[half == 1].mean(), value[half == 0].mean())
        fall = (value**2 - (value - other) ** 2) / variance
        chance = max(self._chance(_frames_of(group)), float(t.sf(sigmas(fall), len(fall) - 1)))
        if sigmas(fall) < _SURE or chance > FALSE_ALARM:
            return None
        size = NamedFigure(
            "excess", float(value.mean()), float(value.std(ddof=1)) / np.sqrt(len(value)), "grey levels"
        )
        brightest = max(group, key=lambda s: s.grey)
        said, place = self._place(order, middle, max(spread, 1.0), radius)
        or_drop = fixed_to != "wall" and self.light == Illumination.LASER
        name, drop = ("glint or droplet", _OR_DROP) if or_drop else ("glint", "")
        return Mismatch(
            name, "line" if self.light == Illumination.LASER else "intensity", fixed_to, place, (size,),
            chance, float((value**2 / variance).mean()), float(((value - other) ** 2 / variance).mean()),
            f"{said} a spot is far brighter than predicted, in {_frames_of(group)} of {len(value)} frames "
            f"that show the place: the wall mirrors a lamp there{drop}.",
            Look(brightest.frame, *brightest.image, 4 * brightest.radius_px),
        )  # fmt: skip

    def _place(
        self, order: str, middle: Float, spread_px: float, radius_px: float
    ) -> tuple[str, tuple[NamedFigure, ...]]:
        if order == "image":
            at = zip(("u_px", "v_px"), middle, strict=True)
            wide = NamedFigure("radius_px", radius_px + spread_px, spread_px, "px")
            said = f"About ({middle[0]:.0f}, {middle[1]:.0f}) of the image"
            return said, (*(NamedFigure(n, float(x), spread_px, "px") for n, x in at), wide)
        mm = self.ring.radius_mm / self.ring.radius_px
        degrees = float(half_turn(np.degrees(middle[1] / self.ring.radius_px)))
        distance = NamedFigure("distance_mm", float(middle[0]) * mm, spread_px * mm, "mm")
        azimuth = NamedFigure(
            "azimuth_deg", degrees, float(np.degrees(spread_px / self.ring.radius_px)), "deg"
        )
        return f"At {distance.value:.0f} mm, azimuth {degrees:.0f}°, of the wall", (distance, azimuth)

    def _brightness(self, middle: Float, radius_px: float, order: str) -> tuple[Float, Float]:
        """Return (F,) mean excess, and variance of a pixel, at a place, in the frames that show it."""
        rows, columns = np.mgrid[: self.excess[0].shape[0], : self.excess[0].shape[1]]
        image, made = ((columns + 0.5) * BLOCK_PX, (rows + 0.5) * BLOCK_PX), []
        for excess, variance, wall in zip(self.excess, self.variance, self.wall, strict=True):
            at = wall if order == "wall" else image
            use = np.hypot(at[0] - middle[0], at[1] - middle[1]) < radius_px + BLOCK_PX
            use &= np.isfinite(excess)
            if use.any():
                made.append((float(excess[use].mean()), float(variance[use].mean())))
        value, variances = np.array(made).reshape(-1, 2).T
        return value, variances

    def _others(self, spots: list[Spot]) -> tuple[Mismatch, ...]:
        """Return the number of spots that do not recur."""
        frames, laser, nan = _frames_of(spots), self.light == Illumination.LASER, float("nan")
        if frames < _FEWEST:
            return ()
        brightest, count = max(spots, key=lambda s: s.grey), len(self.frame)
        rate = NamedFigure("spots", len(spots) / count, float(np.sqrt(len(spots))) / count, "a frame")
        return (Mismatch(
            "", "line" if laser else "intensity", "time", (), (rate,), nan, nan, nan,
            f"In {frames} of {count} frames of the {'laser' if laser else 'lit wall'} spots are far brighter "
            "than predicted, each time elsewhere: glints, sparks, or drops and dust in flight.",
            Look(brightest.frame, *brightest.image, 4 * brightest.radius_px),
        ),)  # fmt: skip


def _about(box: tuple[slice, slice]) -> tuple[slice, slice]:
    """Return a spot's box and what lies within half its size, or at least `_BESIDE_PX`, around it."""
    reach = max(_BESIDE_PX, *((s.stop - s.start) // 2 for s in box))
    down, right = (slice(max(s.start - reach, 0), s.stop + reach) for s in box)
    return down, right


def _stands_out(spot: Bool, grey: float, recorded: Float32, known: Bool) -> bool:
    """Return whether a spot of excess ``grey`` in a cut-out (h, w) stands out in the recorded picture, too.

    A glint does. Wall that only its photo shows too dark, made through a shade on the window, is as bright as
    other wall around it.
    """
    around = recorded[~spot & known]
    if len(around) < _PIXELS[0]:
        return True
    return float(recorded[spot].mean()) - float(np.quantile(around, _ORDINARY)) > _OF_EXCESS * grey


def _frames_of(spots: Sequence[Spot]) -> int:
    return len({s.frame for s in spots})


def window_and_glints(
    window: Sequence[Mismatch], glints: Sequence[Mismatch]
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return what is on the window and what are glints, so that no place of the image is in both.

    What has a name on the window bends or scatters light and makes spots; what is only brighter is a glint.
    """
    kept = [g for g in glints if not any(w.name and meet(w, g, _REACH_PX) for w in window)]
    return tuple(w for w in window if w.name or not any(meet(w, g, _REACH_PX) for g in kept)), tuple(kept)


def _largest_group(spots: list[Spot], order: str) -> list[Spot]:
    """Return the spots near the one that has spots of most frames nearby, in the image or on the wall."""
    at = np.array([s.at(order) for s in spots])
    near = np.hypot(*np.moveaxis(at[:, None] - at[None], -1, 0)) < _REACH_PX
    groups = [[s for s, at_one in zip(spots, row, strict=True) if at_one] for row in near]
    return max(groups, key=_frames_of)
