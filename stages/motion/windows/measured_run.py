"""A long run cut in windows of frames that overlap, so that the work grows with its length and no faster."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Measurements
from stages.motion.bundle_adjustment.unknowns import EncoderReadings, State, straight_start
from stages.motion.parameters import MotionParameters
from stages.motion.rings import ring_bins
from stages.motion.tracking.observations import Tracks
from stages.motion.tracking.tracker import Followed

LOOSE = np.array([0.3, 0.3, 0.3, 0.01, 0.01, 0.01])
_MARGIN_MM = 20.0


@dataclass(frozen=True)
class Window:
    """Frames ``first`` to ``last`` (exclusive) of the list of all frames."""

    first: int
    last: int

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.last - self.first


def cut_windows(frames: int, length: int, overlap: int) -> tuple[Window, ...]:
    """Return windows of one length that cover all frames, each overlapping the next by at least so many."""
    if frames <= length:
        return (Window(0, frames),)
    count = int(np.ceil((frames - overlap) / (length - overlap)))
    first = np.rint(np.linspace(0, frames - length, count)).astype(int)
    return tuple(Window(int(a), int(a) + length) for a in first)


@dataclass(frozen=True)
class MeasuredRun:
    """What was measured over a whole run; a window's part is worked out when it is needed.

    Attributes
    ----------
    followed : Followed
        Texture.
    rings : RingSamples
    ring_place : (F,) int
        Places of the rings' frames in the list of all frames.
    time_s : (N,)
    T_pc : (N, 4, 4)
        First guess in the straightened pipe.
    encoder : EncoderReadings or None
    probe : Probe
        As stated.
    unsure : (P, Q)
        Its principal uncertainties.
    """

    followed: Followed
    rings: RingSamples
    ring_place: Int
    time_s: Float
    T_pc: Float
    encoder: EncoderReadings | None
    probe: Probe
    unsure: Float

    def measured(self, window: Window, parameters: MotionParameters) -> Measurements:
        """Return what was measured in a window, frames and distance counted from its first."""
        part = slice(window.first, window.last)
        tracks = self.followed.between(window.first, window.last)
        rows = slice(*np.searchsorted(self.ring_place, [window.first, window.last]))
        rings = _some_rings(self.rings, rows)
        bins = ring_bins(rings, self.probe, self.unsure, parameters.ring_bins, parameters.surface_sigma_mm)
        place = self.ring_place[rows][np.searchsorted(rings.frame, bins.frame)] - window.first
        return Measurements(
            _ahead_of(tracks, self._start_mm(window)), replace(bins, frame=place), self.time_s[part],
            _since(self.encoder, part), self.probe, self.unsure, LOOSE,
        )  # fmt: skip

    def start(self, window: Window, measured: Measurements, parameters: MotionParameters) -> State:
        """Return the first guess in a window: a straight pipe."""
        T_pc = self.T_pc[window.first : window.last].copy()
        T_pc[:, 2, 3] -= self._start_mm(window)
        return first_guess(
            T_pc, measured, self.followed.grid.radius_mm, self.followed.grid.far_mm, parameters
        )

    def _start_mm(self, window: Window) -> float:
        return float(self.T_pc[window.first, 2, 3]) if window.first else 0.0


def first_guess(
    T_pc: Float, measured: Measurements, radius_mm: float, far_mm: float, parameters: MotionParameters
) -> State:
    """Return a straight pipe about guessed poses (N, 4, 4), as long as its wall was seen."""
    z = T_pc[:, 2, 3]
    span = (float(z.min()) - _MARGIN_MM, float(z.max()) + far_mm + _MARGIN_MM)
    unsure = measured.unsure.shape[1] + MATCH_BIASES
    return straight_start(T_pc, measured.tracks.xyz, *span, radius_mm, parameters.axis_knot_mm, unsure)


def _some_rings(rings: RingSamples, rows: slice) -> RingSamples:
    per_frame = ("frame", "radius_px", "sigma_px", "width_px", "amplitude", "validity")
    return replace(rings, **{name: getattr(rings, name)[rows] for name in per_frame})


def _ahead_of(tracks: Tracks, start_mm: float) -> Tracks:
    T_pc, xyz = tracks.T_pc.copy(), tracks.xyz - np.array([0, 0, start_mm])
    T_pc[:, 2, 3] -= start_mm
    return replace(tracks, T_pc=T_pc, xyz=xyz)


def _since(encoder: EncoderReadings | None, part: slice) -> EncoderReadings | None:
    if encoder is None:
        return None
    distance = encoder.distance_mm[part]
    return replace(encoder, distance_mm=distance - distance[0], known=encoder.known[part])
