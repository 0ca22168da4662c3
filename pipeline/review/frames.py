"""The recorded frames that show a spot of the wall, with the spot and the laser's ring marked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Float, Image, Int
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.artefacts.model import Overlays
from pipeline.errors import BoresightError, InputError
from pipeline.geometry.axis import from_pipe, to_pipe
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording
from pipeline.recording.checks import refuse_changed
from pipeline.review.run_files import RunFiles

_QUALITY = 88
# A wall spot is seen best far off the axis, where texture is largest, but away from the picture's rim.
_BEST_POLAR_RAD = 1.05
# Length over which a pixel's ray is followed to the wall, in radii and steps of 0.5 %.
_NEAREST_RADII, _FARTHEST_RADII, _REACHES = 0.3, 30.0, 900
# Frames within so many radii of a spot are examined; number of runs whose finders are kept in memory.
_NEAR_RADII = 8.0
_KEPT = 2


class UnseenError(BoresightError):
    """No frame shows the spot, or its pictures are gone."""


@dataclass(frozen=True)
class SpotView:
    """A frame that shows a spot.

    Attributes
    ----------
    frame : int
    time_s : float
    illumination : str
    spot_px : (2,)
    ring_px : (M, 2)
        The line measured in this frame; empty without laser.
    """

    frame: int
    time_s: float
    illumination: str
    spot_px: Float
    ring_px: Float


@dataclass(frozen=True)
class FrameFinder:
    """Finds the frames that show a spot of the wall, and the spot that a pixel shows."""

    recording: Recording
    probe: Probe
    trajectory: Trajectory
    rings: RingSamples
    radius_mm: float

    def sights(self, distance_mm: float, azimuth_rad: float) -> tuple[SpotView, ...]:
        """Return the frame whose ring passes the spot, and the lit frame that shows it best.

        Raises
        ------
        UnseenError
            When no frame does.
        """
        axis = self.trajectory.axis
        spot_p = from_pipe(axis, np.array([distance_mm]), np.array([azimuth_rad]), np.array([self.radius_mm]))
        near = self._near(spot_p)
        spot_c = transform(inverse(self.trajectory.T_pc[near]), spot_p)
        polar = np.arctan2(np.hypot(spot_c[:, 0], spot_c[:, 1]), spot_c[:, 2])
        lit_by = self._illumination(near)
        ahead = np.where(np.isin(lit_by, ["laser", "both"]), np.abs(self.off_sheet(spot_c)), np.inf)
        lit = np.where(np.isin(lit_by, ["led", "both"]), np.abs(polar - _BEST_POLAR_RAD), np.inf)
        best = {int(np.argmin(way)): None for way in (ahead, lit) if np.isfinite(way).any()}
        found = tuple(s for k in best if (s := self._sight(near[k], spot_c[k], lit_by[k])) is not None)
        if not found:
            raise UnseenError("no frame shows this spot")
        return found

    def spot(self, frame: int, uv: tuple[float, float]) -> tuple[float, float]:
        """Return distance and azimuth of the wall that a pixel of a frame shows.

        Raises
        ------
        UnseenError
            When the pixel shows no wall, or the frame has no pose.
        """
        at = np.flatnonzero(self.trajectory.frame == frame)
        rays = self.probe.camera.unproject(np.array([uv]))
        if not len(at) or not rays.valid[0]:
            raise UnseenError("no wall is seen there")
        T_pc = self.trajectory.T_pc[at[0]]
        reach = self.radius_mm * np.geomspace(_NEAREST_RADII, _FARTHEST_RADII, _REACHES)
        along_p = T_pc[:3, 3] + reach[:, None] * (T_pc[:3, :3] @ rays.ray[0])
        distance, azimuth, radius = to_pipe(self.trajectory.axis, along_p)
        outside = np.flatnonzero(radius >= self.radius_mm)
        if not len(outside):
            raise UnseenError("no wall is seen there")
        return float(distance[outside[0]]), float(azimuth[outside[0]])

    def image(self, frame: int) -> Image:
        """Return a frame (H, W, 3) BGR.

        Raises
        ------
        UnseenError
            When the recording has no such frame or it cannot be decoded.
        """
        if frame not in self.recording.frames.frame:
            raise UnseenError(f"the recording has no frame {frame}")
        try:
            _, image = next(iter(self.recording.read([frame], "bgr")))
            refuse_changed(self.recording)
        except InputError as error:
            raise UnseenError(str(error)) from error
        if image is None:
            raise UnseenError(f"frame {frame} cannot be decoded")
        return image

    def picture(self, frame: int) -> bytes:
        """Return a frame as JPEG; raises as `image`."""
        encoded, jpeg = cv2.imencode(".jpg", self.image(frame), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        if not encoded:
            raise UnseenError(f"frame {frame} cannot be encoded")
        return jpeg.tobytes()

    def off_sheet(self, spot_c: Float) -> Float:
        """Return the distance (N,), mm, of the spot from the laser's sheet along the optical axis."""
        rho = np.hypot(spot_c[:, 0], spot_c[:, 1])
        azimuth = np.arctan2(spot_c[:, 1], spot_c[:, 0])
        laser = self.probe.laser
        return np.asarray(spot_c[:, 2] - laser.height(azimuth) - rho * laser.slope(azimuth))

    def _near(self, spot_p: Float) -> Int:
        """Return the frames taken near a spot, or all if there are none; long runs have very many."""
        away = np.linalg.norm(self.trajectory.T_pc[:, :3, 3] - spot_p, axis=1)
        near = np.flatnonzero(away < _NEAR_RADII * self.radius_mm)
        return near if len(near) else np.arange(len(away))

    def _illumination(self, near: Int) -> NDArray[np.str_]:
        frames = self.recording.frames
        return np.asarray(frames.illumination[np.searchsorted(frames.frame, self.trajectory.frame[near])])

    def _sight(self, index: int, spot_c: Float, illumination: str) -> SpotView | None:
        uv, valid = self.probe.camera.project(spot_c[None])
        width, height = self.probe.camera.image_size
        inside = valid[0] and 0 <= uv[0, 0] < width and 0 <= uv[0, 1] < height
        if not inside:
            return None
        frame = int(self.trajectory.frame[index])
        return SpotView(
            frame, float(self.trajectory.time_s[index]), str(illumination), uv[0], self._ring(frame)
        )

    def _ring(self, frame: int) -> Float:
        row = np.flatnonzero(self.rings.frame == frame)
        if not len(row):
            return np.zeros((0, 2))
        rings, k = self.rings, row[0]
        used = rings.validity[k] == RingValidity.VALID  # this frame only: a long run has gigabytes
        outward = np.stack([np.cos(rings.azimuth_rad), np.sin(rings.azimuth_rad)], -1)
        return np.asarray(rings.centre_px + rings.radius_px[k, used, None] * outward[used], float)


def finder_of(files: RunFiles) -> FrameFinder:
    """Return the finder of a run, made again when the run was computed again.

    Raises
    ------
    UnseenError
        When the recording or its probe was moved.
    """
    return _finder(files, files.version)


@lru_cache(maxsize=_KEPT)
def _finder(files: RunFiles, _version: str) -> FrameFinder:
    try:
        recording, probe = files.recording(), files.probe()
    except InputError as error:
        raise UnseenError(str(error)) from error
    radius_mm = float(files.artefact(Overlays).nominal_radius_mm)
    return FrameFinder(recording, probe, files.artefact(Trajectory), files.artefact(RingSamples), radius_mm)
