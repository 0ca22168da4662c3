"""A run whose picture grows, measured like a scene, for tests of the image scale."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

from pipeline.arrays import Float
from stages.motion import MotionParameters
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.windows.submaps import Window
from tests.motion_scene import RING_PX, Scene, displaced

GROWS = 0.005


def textured(poses: TrackedPoses) -> SimpleNamespace:
    """Return texture followed with these poses in patches of 4.6 mm."""
    return SimpleNamespace(poses=poses, grid=SimpleNamespace(step_mm=0.22, length_mm=54.0))


FEW = 16


WHOLE = Window(0, FEW)


@dataclass(frozen=True)
class WholeRun:
    """A run in one bore, measured like a scene."""

    made: Scene
    image_scale: Float | None = None
    bore: Bore = ONE_BORE
    whole: Window = WHOLE

    @property
    def time_s(self) -> Float:
        return self.made.measured.time_s

    @property
    def texture(self) -> SimpleNamespace:
        none_lost = np.zeros(FEW, bool)
        return textured(TrackedPoses(np.arange(FEW), self.made.truth.T_pc, none_lost))

    def start(self, window: Window, measured: Measurements, parameters: MotionParameters) -> State:
        """Return a first guess: the truth with errors of about those of tracking."""
        return displaced(self.made.truth, np.random.default_rng(5))

    def measured(self, window: Window, parameters: MotionParameters) -> Measurements:
        """Return the same measurements with the scale as recorded."""
        was = self.made.measured
        if self.image_scale is None:
            return was
        tracks = was.tracks.reduced(self.image_scale, was.probe.camera.centre_px)
        larger = RING_PX * (self.image_scale - 1)[was.rings.frame, None] * was.rings.by_pixel
        return replace(was, tracks=tracks, rings=replace(was.rings, xyz_c=was.rings.xyz_c - larger))
