"""Whether a finding lies where something stays in the picture while the wall moves.

Burnt-in text, a logo, dirt on the window or a part of the probe may be taken for the line, or hide a part of
it. What is taken for the line departs from the wall, in as many rings as the line needs to pass, and no photo
contradicts it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.recording.base import Illumination, Recording
from stages.defects.segment import Region
from stages.defects.surface import Surface, cells_of

# A sample shows a finding if it departs from the wall by half of its depth; the finding lies where something
# stays if half of these samples do.
_HALF = 0.5
# Edges of what stays are known to the box over which it is summed (`stages.premises.stays`), in heights of
# the picture.
_RIM = 9 / 600


@dataclass(frozen=True)
class StaticPlaces:
    """Where pictures show something that stays while the wall moves.

    Attributes
    ----------
    stays : (H, W) bool
        True where something stays, or may.
    rings : RingSamples
        The laser line in these pictures.
    """

    stays: Bool
    rings: RingSamples

    @classmethod
    def of(cls, recording: Recording, rings: RingSamples) -> StaticPlaces | None:
        """Return the places of a recording; None without any.

        None as well where the laser is on in lit pictures: the line stays there, too.
        """
        both = bool(np.any(recording.frames.illumination == Illumination.BOTH.value))
        if recording.stays is None or both:
            return None
        return cls(_with_rim(recording.stays, recording.source.image_size), rings)

    def explain(self, region: Region, depth_mm: float, surface: Surface) -> bool:
        """Return whether most samples that show a finding of this depth, mm, lie where something stays."""
        points = surface.near
        i, j, inside = cells_of(points, surface.relief, region)
        height = np.sign(depth_mm) * (points.radius_mm - surface.relief.shape_at(i, j))
        showing = inside & (height > _HALF * abs(depth_mm))
        frames = np.unique(points.frame[showing])
        hidden = [self._at(int(k), showing[points.frame == k]) for k in frames]
        return bool(np.mean(np.concatenate(hidden)) > _HALF) if hidden else False

    def _at(self, frame: int, showing: Bool) -> Bool:
        """Return whether something stays at those of a frame's points that are ``showing`` (n,)."""
        rings, ring = self.rings, int(np.searchsorted(self.rings.frame, frame))
        used = np.flatnonzero(rings.validity[ring] == RingValidity.VALID)
        # Points are in the order of their ring's samples, of which a few have no point on the wall.
        used = used[np.linspace(0, len(used) - 1, len(showing)).round().astype(int)][showing]
        radius, azimuth = rings.radius_px[ring, used].astype(float), rings.azimuth_rad[used]
        u, v = (
            _pixel(c + radius * way(azimuth))
            for c, way in zip(rings.centre_px, (np.cos, np.sin), strict=True)
        )
        height, width = self.stays.shape
        return np.asarray(self.stays[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)])


def _with_rim(stays: Bool, image_size: tuple[int, int]) -> Bool:
    """Return where on the whole picture (H, W) something stays or may; ``stays`` is on the reduced one."""
    whole = cv2.resize(stays.astype(np.uint8), image_size, interpolation=cv2.INTER_NEAREST)
    reach = round(_RIM * image_size[1])
    box = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return np.asarray(cv2.dilate(whole, box) > 0)


def _pixel(place: Float) -> Int:
    return np.asarray(np.rint(place), np.int64)
