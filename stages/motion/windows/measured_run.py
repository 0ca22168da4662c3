"""The measurements of a whole run, from which every window takes its part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.artefacts.motion import LaserKnock
from pipeline.instrument.probe import Probe
from stages.motion.bore import Bore
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Measurements
from stages.motion.bundle_adjustment.laser_knock import RingJump
from stages.motion.bundle_adjustment.unknowns import State, straight_start
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.rings import RingBins, RingCircles, ring_bins
from stages.motion.stated_probe import scale_sigma_of
from stages.motion.tracking.landmarks import Tracks
from stages.motion.tracking.tracker import TrackedTexture
from stages.motion.windows.submaps import Window

_MARGIN_MM = 20.0
"""Length of axis before the first and beyond the last wall in view, for poses that move while adjusted."""
_HELD = 0.01
"""Share of the stated σ within which a held probe is: in a reducer, texture that is matched wrongly on the
slope moved a correct probe by 8 σ, so that a bore of 101.4 mm came out as 99.4 mm."""


@dataclass(frozen=True)
class MeasuredRun:
    """The measurements of a whole run; a window's part is computed when it is needed.

    Attributes
    ----------
    texture : TrackedTexture
    rings : RingSamples
    ring_place : (F,) int
        Indices of the rings' frames in the list of all frames.
    time_s : (N,)
    T_pc : (N, 4, 4)
        First guess in the straightened pipe.
    encoder : EncoderReadings or None
    probe : Probe
        As stated.
    bore : Bore
        Bore of the straightened pipe.
    circles : RingCircles
        Circles through the rings.
    image_scale : (N,) or None
        Size of the pictures over that of the probe's camera; None if their scale does not drift.
    jump : RingJump or None
        Jump of the rings, if any.
    knock : LaserKnock or None
        Change of the laser there.
    farthest_rad : float
        Smallest polar angle of matches of texture that are used: the wall farthest ahead.
    held_sigma : float
        Relative 1 σ of lengths by the stated σ of a probe that is held; 0 if the adjustment knows it.
    """

    texture: TrackedTexture
    rings: RingSamples
    ring_place: Int
    time_s: Float
    T_pc: Float
    encoder: EncoderReadings | None
    probe: Probe
    bore: Bore
    circles: RingCircles
    image_scale: Float | None = None
    jump: RingJump | None = None
    knock: LaserKnock | None = None
    farthest_rad: float = 0.0
    held_sigma: float = 0.0

    @property
    def whole(self) -> Window:
        """Return the window of all frames."""
        return Window(0, len(self.time_s))

    def with_probe_held(self) -> MeasuredRun:
        """Return the run with a probe that texture cannot change."""
        held = replace(self.probe, covariance=_HELD**2 * self.probe.covariance)
        return replace(self, probe=held, held_sigma=scale_sigma_of(self.probe, self.texture.grid.radius_mm))

    def measured(self, window: Window, parameters: MotionParameters) -> Measurements:
        """Return the measurements of a window, with frames and distance counted from its first."""
        part = slice(window.first, window.last)
        rows = slice(*np.searchsorted(self.ring_place, [window.first, window.last]))
        rings, place = self.rings.some(rows), self.ring_place[rows] - window.first
        rings = rings if self.image_scale is None else rings.reduced(self.image_scale[self.ring_place[rows]])
        bins = self._bins(rings, place, parameters)
        tracks = _behind(self.texture.between(window.first, window.last), self.start_mm(window))
        if self.image_scale is not None:
            tracks = tracks.reduced(self.image_scale[part], self.probe.camera.centre_px)
        if self.farthest_rad:
            tracks = tracks.some(tracks.polar_angle(self.probe.camera) >= self.farthest_rad)[0]
        encoder = _since_first(self.encoder, part)
        return Measurements.of(tracks, bins, self.time_s[part], encoder, self.probe)

    def knocked(self, knock: LaserKnock) -> MeasuredRun:
        """Return the run with a knock of the laser at the jump of the rings."""
        return replace(self, knock=knock, bore=self.bore if self.jump is None else self.jump.bore)

    def _bins(self, rings: RingSamples, place: Int, parameters: MotionParameters) -> RingBins:
        bins, wall_mm = parameters.ring_bins, parameters.surface_sigma_mm
        if self.knock is None:
            return ring_bins(rings, place, self.probe, bins, wall_mm)
        first = int(np.searchsorted(rings.frame, self.knock.frame))
        after = replace(self.probe.after(self.knock), covariance=self.probe.covariance)
        parts = (slice(0, first), self.probe), (slice(first, None), after)
        return RingBins.joined(
            [ring_bins(rings.some(rows), place[rows], probe, bins, wall_mm) for rows, probe in parts]
        )

    def start(self, window: Window, measured: Measurements, parameters: MotionParameters) -> State:
        """Return the first guess in a window: a straight pipe with the length of the wall in view."""
        T_pc = self.T_pc[window.first : window.last].copy()
        T_pc[:, 2, 3] -= self.start_mm(window)
        z, grid = T_pc[:, 2, 3], self.texture.grid
        span = (float(z.min()) - _MARGIN_MM, float(z.max()) + grid.far_mm + _MARGIN_MM)
        corrections = measured.unsure.shape[1] + MATCH_BIASES
        bore = self.bore.counted_from(self.start_mm(window))
        straight = straight_start(
            T_pc, measured.tracks.xyz, *span, grid.radius_mm, parameters.axis_knot_mm, corrections
        )
        if not bore.reduces:
            return replace(straight, bore=bore)
        rings = measured.rings
        bore = bore.measured_by(rings.xyz_c, rings.by_instrument, grid.radius_mm)
        return replace(straight, bore=bore, guess_mm=z)

    def start_mm(self, window: Window) -> float:
        """Return the distance of a window's first frame, mm, from which its own distances are counted."""
        return float(self.T_pc[window.first, 2, 3]) if window.first else 0.0


def _behind(tracks: Tracks, start_mm: float) -> Tracks:
    """Return tracks with distance counted from ``start_mm``."""
    T_pc, xyz = tracks.poses.T_pc.copy(), tracks.xyz - np.array([0, 0, start_mm])
    T_pc[:, 2, 3] -= start_mm
    return replace(tracks, poses=replace(tracks.poses, T_pc=T_pc), xyz=xyz)


def _since_first(encoder: EncoderReadings | None, part: slice) -> EncoderReadings | None:
    if encoder is None:
        return None
    distance = encoder.distance_mm[part]
    return replace(encoder, distance_mm=distance - distance[0], known=encoder.known[part])
