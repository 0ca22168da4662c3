"""What is found in the compared frames, in the order in which one finding decides about the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.artefacts.measured import RingSamples
from pipeline.artefacts.twin import Mismatch
from pipeline.artefacts.wall_map import FixedToProbe
from pipeline.recording.base import Recording
from stages.twin.at_times import dark_spots
from stages.twin.colours import beside_colour, few_lit
from stages.twin.dark_side import beside_dark_side
from stages.twin.fine_noise import beside_coding
from stages.twin.fixed_line import beside_absent_light, on_line
from stages.twin.flicker import beside_spots
from stages.twin.glints import window_and_glints
from stages.twin.name import clipped
from stages.twin.on_wall import ring_step_mm, unnamed
from stages.twin.over_time import changes_over_time
from stages.twin.reference import BlockSamples
from stages.twin.scene import Scene
from stages.twin.seen_in_photo import beside_sectors, separated_from_photo
from stages.twin.state import PhotometricState
from stages.twin.sums import Sums
from stages.twin.window import separated_from_blur

Told = tuple[Mismatch, ...]


@dataclass(frozen=True)
class Compared:
    """Frames that were compared with their twins.

    Attributes
    ----------
    scene : Scene
    state : PhotometricState
    recording : Recording
    rings : RingSamples
    lit : list of int
        Compared frames that show the wall.
    sums : Sums
    samples : BlockSamples or None
        Of ``sums``.
    pixels : tuple of Mismatch
        Defective pixels of the sensor, found before.
    fixed : FixedToProbe or None
        What stays at one place of the line.
    """

    scene: Scene
    state: PhotometricState
    recording: Recording
    rings: RingSamples
    lit: list[int]
    sums: Sums
    samples: BlockSamples | None
    pixels: Told = ()
    fixed: FixedToProbe | None = None

    def findings(self) -> tuple[Told, Told]:
        """Return what is found, and what is withdrawn: another finding or other frames speak against it."""
        colour = self.recording.read(few_lit(self.lit), "bgr")
        over_time, slow = changes_over_time(self.sums, self.samples, self.scene, self.state, colour)
        whole, not_whole = self._of_whole_pictures(over_time)
        on_window, glints, of_photo, not_there = self._on_window(whole, over_time)
        over_time = beside_spots(over_time, glints)
        clear = (*on_window, *glints, *of_photo)
        placed = (*on_window, *self._on_wall(clear), *glints)
        placed, beside = beside_sectors(placed, (*over_time, *slow), self.scene.ring, self.samples)
        placed, of_side = beside_dark_side(placed, over_time, self.samples, self.scene)
        found = (*over_time, *placed, *dark_spots(self.samples, clear), *self._counted(whole))
        return found, (*not_whole, *slow, *not_there, *of_photo, *beside, *of_side)

    def _of_whole_pictures(self, over_time: Told) -> tuple[Told, Told]:
        """Return effects on the whole picture, and withdrawn ones."""
        led_failed = any("led_dead" in m.name for m in over_time)
        whole, withdrawn = self.sums.named(self.samples, self.recording, led_failed)
        whole, of_colour = beside_colour(whole, over_time)
        return whole, (*withdrawn, *of_colour)

    def _on_window(self, whole: Told, over_time: Told) -> tuple[Told, Told, Told, Told]:
        """Return what is on the window, glints, what the photo of the wall shows, and what is withdrawn."""
        ring = self.scene.ring
        on_window, of_photo = separated_from_photo(self.sums.on_window(self.samples), ring)
        on_window, unsure = separated_from_blur(on_window, whole)
        of_line = on_line(self.fixed, self.rings, ring, on_window)
        of_line, absent = beside_absent_light(of_line, over_time, ring)
        of_line, coded = beside_coding(of_line, over_time)
        on_window = (*on_window, *of_line)
        on_window, glints = window_and_glints(on_window, self.sums.glints(whole, on_window))
        return on_window, glints, of_photo, (*absent, *coded, *unsure)

    def _on_wall(self, clear: Told) -> Told:
        """Return what is fixed to the wall or to rows, away from what was found at a place of the image."""
        ring, apart_mm = self.scene.ring, ring_step_mm(self.rings, self.scene.trajectory)
        line_rad = float(np.arctan2(ring.radius_mm, ring.ahead_mm))
        samples = self.samples and self.samples.clear_of(clear)
        return unnamed(samples, self.scene.surface, apart_mm, line_rad)

    def _counted(self, whole: Told) -> Told:
        """Return defective pixels, effects on the whole picture, and what is clipped."""
        of_wall = self.sums.comparison.clipped_share
        return (*self.pixels, *whole, *clipped(self.rings, self.state.line_clipped, of_wall))
