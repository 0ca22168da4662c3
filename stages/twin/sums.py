"""Sums over the compared frames, and the same frames rendered again to judge suspected effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pipeline.arrays import Bool, Float32, Image, Int
from pipeline.artefacts.twin import Mismatch
from pipeline.recording.base import Illumination, Recording
from stages.twin.cells import Cells, CellsOfFrames, sectors_of
from stages.twin.compare import Comparison, exposure_of
from stages.twin.dead_led import dead_led
from stages.twin.fine_noise import FineNoise
from stages.twin.gate import Suspected, first_confirmed, judged
from stages.twin.glints import SpotsOfFrames
from stages.twin.lamp_power import power_of_lamps
from stages.twin.lamps import beside_response, separated_from_wall, uneven_lamps
from stages.twin.locate import ImagePlace, without_duplicates
from stages.twin.name import beside_clipping, focus_of, response_of
from stages.twin.picture import WholePictures
from stages.twin.reference import BlockSamples, BlocksOfFrames, in_image
from stages.twin.render import Renderer
from stages.twin.scene import Scene
from stages.twin.state import PhotometricState
from stages.twin.stray_light import STRAY_NAMES
from stages.twin.switched import Shown
from stages.twin.unexplained import unexplained
from stages.twin.window import WindowPlace

MOST_STRAY = 8
"""Most laser frames that are examined for stray light: each takes as long as a lit frame."""


class Sums:
    """Sums over the compared frames: χ², blocks, places of dirt, and brightness in sectors.

    ``clipped`` gives, by frame number, pixels (H, W) that clip in at least one colour; ``examined``
    are the laser frames that are examined for stray light.
    """

    def __init__(
        self, scene: Scene, state: PhotometricState, places: tuple[ImagePlace, ...],
        clipped: Mapping[int, Bool] | None = None, examined: Sequence[int] = (),
    ) -> None:  # fmt: skip
        scene = replace(scene, outside=state.outside)
        self._clipped, self._examined = {} if clipped is None else clipped, set(examined)
        self._scene, self._state, self._light = scene, state, dict[int, Illumination]()
        self._renderer = Renderer(scene, state)
        self.comparison = Comparison()
        self.window = [WindowPlace(p, aside_px=p.most_of(state.aside)) for p in places]
        self.blocks = BlocksOfFrames(scene.ring)
        self.lit, self.line = CellsOfFrames(), CellsOfFrames()
        self.whole, self.fine = WholePictures(scene), FineNoise()
        self.spots = [
            SpotsOfFrames(kind, scene.ring, state.outside) for kind in (Illumination.LED, Illumination.LASER)
        ]
        self._sector = sectors_of(scene.polar[1])

    def add(self, frame: int, kind: Illumination, image: Image) -> None:
        """Compare a frame (H, W) with its twin."""
        noise, self._light[frame] = self._state.noise, kind
        white, above = noise.full_scale, noise.above_black(image)
        before = self._renderer.frame(frame, kind)
        gain, aside = self._state.gain_map, self._state.aside
        bent = before.drawn_aside(aside)
        after = bent if gain is None else bent.brighter(gain, noise)
        free = self._free(frame, above)
        if kind != Illumination.LASER:
            self.lit.add(frame, above, after, white, self._sector)
        if kind == Illumination.LASER:
            self.line.add_line(frame, above, after, white, self._sector)
        if kind in self._state.shows_wall:
            self.blocks.add(frame, above, before, white)
        exposure = float(np.exp(exposure_of(above, after)))
        after = after.brighter(exposure, noise)
        if kind in self._state.shows_wall:
            exposed = after if gain is None and aside is None else before.brighter(exposure, noise)
            drawn = None if aside is None else np.float32(exposure) * bent.level
            for place in self.window:
                place.add(frame, above, exposed, free, drawn)
            self.whole.add_lit(frame, above, after, free)
            self.fine.add(frame, above, after, free)
            self.spots[0].add(frame, above, exposed)
        if kind != Illumination.LED:
            self.whole.frame["line"].append(frame)
        if kind == Illumination.LASER:
            self.spots[1].add(frame, above, after)
        if frame in self._examined:
            lit = self._renderer.frame(frame, Illumination.LED)
            self.whole.add_laser(frame, above, after, free, lit)
        self.whole.add_clipped(frame, above, after, free)
        self.comparison.add(frame, kind, above, before, after, noise)

    def _free(self, frame: int, above: Float32) -> Bool:
        """Return pixels (H, W) of a frame that clip neither in grey nor, where known, in a colour."""
        free = np.asarray(above < self._state.noise.full_scale)
        return free & ~self._clipped[frame] if frame in self._clipped else free

    def on_window(self, samples: BlockSamples | None) -> tuple[Mismatch, ...]:
        """Return what is on the window or the lens; places that other frames do not confirm are left out."""
        fixed_to = in_image(samples, tuple(w.place for w in self.window))
        judged = [
            w.judged(to, len(self.window)) or (unexplained(w.place, samples) if to == "image" else None)
            for w, to in zip(self.window, fixed_to, strict=True)
        ]
        return without_duplicates([m for m in judged if m is not None])

    def glints(self, whole: Sequence[Mismatch], on_window: Sequence[Mismatch] = ()) -> tuple[Mismatch, ...]:
        """Return spots far brighter than predicted; ``whole`` are confirmed effects on the whole picture.

        Spots of lit frames are left out where something ``on_window`` bends light: what is likeliest a
        drop, or what displaces the line.
        """
        stray = [m.parameters[0].value for m in whole if set(m.names) & set(STRAY_NAMES)]
        bends = [m for m in on_window if m.names[0] == "droplet" or m.channel == "line"]
        lit, laser = self.spots
        return (*lit.found(bent=bends), *laser.found(max(stray, default=0.0)))

    def cells(self) -> tuple[Cells | None, Cells | None]:
        """Return the sectors of lit frames and of the line, twins having steady lamps and an even laser.

        The line has none where it is clipped, since it then hardly shows the laser's power.
        """
        state = self._state
        lit, line = self.lit.cells(), None if state.line_is_clipped else self.line.cells()
        if lit is not None and state.lamp is not None:
            lit = lit.on(-np.array([[state.lamp.gain.at(f)] for f in lit.frame]))
        if line is not None and state.line is not None:
            power = [[state.line.course.at(f)] for f in line.frame]
            line = line.on(-np.array(power) - state.line.sector_power)
        return lit, line

    def named(
        self, samples: BlockSamples | None, recording: Recording, led_failed: bool = False
    ) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
        """Return effects on the whole picture that frames rendered again confirm, and those withdrawn.

        An LED that failed during the run also leaves the lamps' mean pattern uneven, and is not reported
        twice.
        """
        again = partial(self._shown, recording)
        power = power_of_lamps(samples, self._scene.ring)
        lamps, dark, of_wall = self._lamps(samples, led_failed)
        if power:  # how uneven lamps are was estimated by light that brightness does not follow
            uneven = (*(one.mismatch for one in lamps), *dark)
            of_wall, lamps, dark = (*of_wall, *map(beside_response, uneven)), (), ()
        contrast = () if self._state.black_in_photo else response_of(samples, self._scene.ring)
        first = (*self.whole.suspected(self._state.sharpness), *contrast, *power, *lamps)
        kept, withdrawn = judged(first, again)
        if self.comparison.wall_is_clipped:
            kept, unsure = beside_clipping(kept)
            withdrawn = (*withdrawn, *unsure)
        focus, not_focus = first_confirmed(focus_of(self._state, self.whole, kept), again)
        return (*kept, *focus, *dark), (*withdrawn, *not_focus, *of_wall)

    def _lamps(
        self, samples: BlockSamples | None, led_failed: bool
    ) -> tuple[tuple[Suspected, ...], tuple[Mismatch, ...], tuple[Mismatch, ...]]:
        """Return the cause of lamps that are uneven in all frames, a dark side, and what is not confirmed.

        The run's own photo contains most of an unevenness, which then shows only in its change over polar
        angle: the dark side, which has no name. Wall seen twice does not confirm the last.
        """
        if led_failed:
            return (), (), ()
        lamp = self._state.lamp
        uneven = uneven_lamps(lamp, self._scene, self.whole.frames_of("blur"))
        uneven, of_wall = separated_from_wall(uneven, lamp, self._scene, samples)
        if any("led_dead" in one.mismatch.names for one in uneven):
            return uneven, (), of_wall
        return uneven, dead_led(samples, self._scene), of_wall

    def _shown(self, recording: Recording, frames: Int) -> Iterator[tuple[int, Shown]]:
        """Yield compared frames again, each with functions that render it under other assumptions."""
        noise, gain = self._state.noise, self._state.gain_map
        for frame, image in recording.read(frames, "grey"):
            if image is None:
                continue
            above = noise.above_black(image)
            twin = self._renderer.frame(frame, self._light[frame])
            twin = twin if gain is None else twin.brighter(gain, noise)
            exposure = float(np.exp(exposure_of(above, twin)))
            yield (
                frame,
                Shown(
                    above, twin.brighter(exposure, noise), self._free(frame, above),
                    self._scene, partial(self._again, frame, exposure),
                    partial(self._renderer.frame, frame, Illumination.LED), self.whole.direction(frame),
                    frame,
                ),
            )  # fmt: skip

    def _again(self, frame: int, exposure: float, **changes: Any) -> Float32:
        """Return the grey levels (H, W) of a frame with some attributes of the state changed.

        ``sharpness=None`` leaves the photo as it is; ``line`` and ``lamp`` are functions of what they change.
        """
        state, noise = self._state, self._state.noise
        if "sharpness" in changes:
            changes["sharpness"] = np.zeros_like(state.sharpness)
        for light in {"line", "lamp"} & changes.keys():
            changes[light] = changes[light](getattr(state, light))
        made = Renderer(self._scene, replace(state, **changes)).frame(frame, self._light[frame])
        made = made if state.gain_map is None else made.brighter(state.gain_map, noise)
        return made.brighter(exposure, noise).level
