"""Synthetic whole pictures of lit wall and of the laser line, with what the twin finds in them."""

from types import SimpleNamespace

import cv2
import numpy as np

from stages.twin.gate import first_confirmed, judged
from stages.twin.line_light import _plain_line
from stages.twin.name import focus_of, response_of
from stages.twin.picture import WholePictures
from stages.twin.reference import BlocksOfFrames
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.switched import Shown

SHAPE, FRAMES, WHITE = (240, 320), 8, 200.0
V, U = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]].astype(np.float32)
AWAY, PHI = np.hypot(V - 120, U - 160), np.arctan2(V - 120, U - 160)
OUTSIDE = AWAY > 180
"""Corners of the picture, which see no wall."""
RING = Ring((160.0, 120.0), 70.0, 50.0, 25.0)
LINE_LIGHT = _plain_line(0.1, 2.4)
SCENE = SimpleNamespace(
    polar=(AWAY / 70, PHI, AWAY > 0), ring=RING, surface=SimpleNamespace(mean_radius_mm=50.0), outside=OUTSIDE
)


def twin_of(level, region):
    """Return a twin (H, W) of these grey levels, on wall of a straight bore."""
    place = (50.0 * 70 / np.maximum(AWAY, 20)).astype(np.float32)
    noise, even = np.full(SHAPE, 2.0, np.float32), np.ones(SHAPE, np.float32)
    return TwinFrame(level, noise, region.astype(np.uint8), place, PHI, even)


def lit_wall(random):
    """Return a twin of textured wall in even light."""
    fine = cv2.GaussianBlur(random.standard_normal(SHAPE).astype(np.float32), (0, 0), 2.5)
    wide = cv2.GaussianBlur(random.standard_normal(SHAPE).astype(np.float32), (0, 0), 12)
    level = 90 + 20 * fine / fine.std() + 15 * wide / wide.std()
    return twin_of(np.clip(level, 15, 180).astype(np.float32), np.where(OUTSIDE, Region.DARK, Region.WALL))


def line_of_laser():
    """Return a twin of the line, a circle."""
    level = 150 * np.exp(-0.5 * ((AWAY - 70) / 1.5) ** 2)
    region = np.where(abs(AWAY - 70) < 1.5, Region.LINE_CORE, Region.DARK)
    return twin_of(
        level.astype(np.float32),
        np.where((region == Region.DARK) & (abs(AWAY - 70) < 9), Region.LINE_FLANK, region),
    )


def noisy(picture, random):
    """Return a picture (H, W) with noise of 1 σ of 1.4 grey levels."""
    return (picture + 1.4 * random.standard_normal(SHAPE)).astype(np.float32)


def named(lit=lambda p, r: p, laser=lambda p, r: p, of_sharpness=0.0):
    """Return the names of confirmed effects."""
    return [m.name for m in found_in(lit, laser, of_sharpness)[0]]


def found_in(lit=lambda p, r: p, laser=lambda p, r: p, of_sharpness=0.0, judge=None):
    """Return confirmed and withdrawn effects; ``judge`` changes the frames that are rendered again."""
    random, whole, blocks = np.random.default_rng(2), WholePictures(SCENE), BlocksOfFrames(RING)
    shown = {}
    for frame in range(FRAMES):
        twin, line = lit_wall(random), line_of_laser()
        seen = np.minimum(noisy(lit(twin.level, random), random), WHITE)
        free = seen < WHITE
        whole.add_lit(frame, seen, twin, free)
        whole.add_clipped(frame, seen, twin, free)
        blocks.add(frame, seen, twin, WHITE)
        shown[frame] = shown_of(
            seen if judge is None else judge(twin.level, random), twin, twin, frame, whole
        )
        seen = noisy(np.where(OUTSIDE, 0, laser(line.level, random)), random)
        whole.add_laser(FRAMES + frame, seen, line, seen < WHITE, twin)
        shown[FRAMES + frame] = shown_of(seen, line, twin, FRAMES + frame, whole)
    state = SimpleNamespace(sharpness=np.full(4, of_sharpness), lamp=True, line=None)
    first = (*whole.suspected(state.sharpness), *response_of(blocks.samples(), RING))
    kept, withdrawn = judged(first, lambda frames: [(f, shown[f]) for f in frames])
    focus, not_focus = first_confirmed(
        focus_of(state, whole, kept), lambda frames: [(f, shown[f]) for f in frames]
    )
    return (*kept, *focus), (*withdrawn, *not_focus)


def shown_of(seen, twin, lit, frame, whole):
    """Return a recorded picture (H, W) beside its twin, for rendering again."""

    def again(sharpness=None, power=1.0):
        return (100 * (twin.level / 100) ** power).astype(np.float32)

    return Shown(seen, twin, seen < WHITE, SCENE, again, lambda: lit, whole.direction(frame))
