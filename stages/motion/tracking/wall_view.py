"""The lit frames of a recording: pictures of the wall, and how they are unrolled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Image, Int
from pipeline.instrument.probe import Probe
from pipeline.recording.background import in_background
from pipeline.recording.base import Illumination, Recording
from stages.motion.tracking.strips import Strip, StripGrid, softened, unroll

_BLUE, _RED = 0, 2
_YELLOW_NM = 575.0
_AHEAD = 4


@dataclass(frozen=True)
class WallView:
    """What shows the wall to the motion stage."""

    recording: Recording
    probe: Probe
    grid: StripGrid

    @property
    def lit(self) -> Int:
        """Return the lit frames (K,) as places in the list of all frames."""
        frames = self.recording.frames
        return self._place(frames.of(Illumination.LED, Illumination.BOTH))

    @property
    def blocked_mm(self) -> tuple[float, float]:
        """Return the range of wall ahead of the camera hidden under the laser line; empty if equal."""
        # The line is a few σ wide on the wall; its glow is a slope that the normalisation takes out.
        half = 12 * self.probe.laser.line_sigma_mm if self._both else 0.0
        return self.probe.laser.baseline_mm - half, self.probe.laser.baseline_mm + half

    def images(self, place: Int) -> Iterator[tuple[int, Image | None]]:
        """Yield places and softened grey pictures; with the laser on, the colour its light reaches least."""
        # Softened on another thread while the picture before is worked on.
        for frame, image in in_background(self._softened(self.recording.frames.frame[place]), _AHEAD):
            yield int(self._place(np.array(frame))), image

    def strips(self, place: Int, T_pc: Float) -> Iterator[Strip | None]:
        """Yield frames (n,), ascending, unrolled from poses (n, 4, 4) in the straightened pipe."""
        for (_, image), T in zip(self.images(place), T_pc, strict=True):
            yield None if image is None else unroll(image, self.probe, T, self.grid, self.blocked_mm)

    @property
    def _both(self) -> bool:
        return bool(np.any(self.recording.frames.illumination == Illumination.BOTH.value))

    def _place(self, frame: Int) -> Int:
        return np.asarray(np.searchsorted(self.recording.frames.frame, frame))

    def _softened(self, frame: Int) -> Iterator[tuple[int, Image | None]]:
        channel = _RED if self.probe.laser.wavelength_nm < _YELLOW_NM else _BLUE
        for number, image in self.recording.read(frame, "bgr" if self._both else "grey"):
            grey = np.ascontiguousarray(image[..., channel]) if image is not None and self._both else image
            yield number, None if grey is None else softened(grey)
