"""Fine noise of lit frames, and from which frame on it is another: the recording is coded differently.

A lossy codec removes noise between neighbouring pixels, and with it faint light: lines and dark wall lose or
gain some tenths of their light, in patches. No light explains that, so that no light is named for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float32
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring

_ROWS, _FEWEST_PIXELS = 4, 1000
"""Every fourth row is used: a hundred thousand pixels are enough. Fewest pixels of a frame."""
_BESIDE, _FEWEST = 3, 2
"""Most and fewest frames on either side of a change that show it."""
_LEAST, _SURE = 0.22, 6.0
"""Least change of the noise's logarithm, and its least size in spreads of the other steps between frames.
Chosen: sound recordings of two renderers change by .05 between frames, crf 34 after 16 by .5 and 2.2."""
_NOISE = "noise"
"""Name of the figure by which a change of the coding is known."""


@dataclass
class FineNoise:
    """Noise between neighbouring pixels of lit wall over what the model states, frame by frame."""

    frame: list[int] = field(default_factory=list)
    log_noise: list[float] = field(default_factory=list)

    def add(self, frame: int, above: Float32, twin: TwinFrame, free: Bool) -> None:
        """Add a lit frame (H, W) whose twin has its exposure; ``free`` marks pixels that are not clipped."""
        upper, lower = slice(0, -1, _ROWS), slice(1, None, _ROWS)
        use = free & (twin.region == Region.WALL)
        both = use[upper] & use[lower]
        use = both[:, 1:] & both[:, :-1]
        if int(use.sum()) < _FEWEST_PIXELS:
            return
        rest = (above[upper] - twin.level[upper]) - (above[lower] - twin.level[lower])
        twice = (rest[:, 1:] - rest[:, :-1])[use] / np.sqrt(4 * twin.variance[upper][:, 1:][use])
        self.frame.append(frame)
        self.log_noise.append(float(np.log(max(robust_spread(twice), 1e-3))))

    def step(self, ring: Ring) -> tuple[Mismatch, ...]:
        """Return the change of fine noise from one frame to the next, if there is one beside its scatter."""
        course, count = np.array(self.log_noise), len(self.log_noise)
        sizes = np.array([
            np.median(course[k : k + _BESIDE]) - np.median(course[max(k - _BESIDE, 0) : k])
            for k in range(_FEWEST, count - _FEWEST + 1)
        ])  # fmt: skip
        if len(sizes) < _FEWEST:
            return ()
        jumps = np.diff(course)[_FEWEST - 1 : count - _FEWEST]
        best = int(np.argmax(np.minimum(np.abs(sizes), np.abs(jumps))))
        scatter = robust_spread(np.delete(np.diff(course), best + _FEWEST - 1))
        if min(abs(sizes[best]), abs(jumps[best])) < max(_LEAST, _SURE * scatter):
            return ()
        return (self._mismatch(best + _FEWEST, float(sizes[best]), scatter, ring),)

    def _mismatch(self, first: int, size: float, scatter: float, ring: Ring) -> Mismatch:
        last, here = self.frame[first - 1], self.frame[first]
        change, nan = float(np.expm1(size)), float("nan")
        at = NamedFigure("frame_from", (here + last) / 2, (here - last) / np.sqrt(12), "frame")
        noise = NamedFigure(_NOISE, change, float(np.exp(size)) * scatter, "relative")
        said = (
            f"From frame {at.value:.0f} on, lit frames have {100 * abs(change):.0f} % "
            f"{'more' if change > 0 else 'less'} noise between neighbouring pixels than before, beside what "
            "their brightness explains: the recording is coded differently from there on, or the camera "
            "amplifies or smooths its pictures differently. What to do: record with the same settings "
            "throughout."
        )
        return Mismatch("", "intensity", "time", (at,), (noise,), nan, nan, nan, said, ring.whole(here))


def beside_coding(
    found: Sequence[Mismatch], over_time: Sequence[Mismatch]
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return the findings that remain beside a change of the coding, and those withdrawn for it.

    It is among what changes ``over_time``. Withdrawn are those of the line, which is faint, and those of
    lit frames that begin with the change.
    """
    coding = [c for c in over_time if any(p.name == _NOISE for p in c.parameters)]
    left = tuple(m for m in found if any(m.channel == "line" or _begins_with(m, c) for c in coding))
    said = "{} But the recording is coded differently from frame {:.0f} on, which changes faint light, too."
    withdrawn = tuple(
        replace(m, statement=said.format(m.statement, c.place[0].value)) for m in left for c in coding
    )
    return tuple(m for m in found if m not in left), withdrawn


def _begins_with(found: Mismatch, coding: Mismatch) -> bool:
    """Return whether a change may begin at the frame at which the coding changes."""
    first = next((p for p in found.place if p.name == "frame_from"), None)
    at = coding.place[0]
    return first is not None and abs(first.value - at.value) <= np.sqrt(12) * max(first.sd, at.sd)
