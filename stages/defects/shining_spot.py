"""Tell a spot of the wall that shines beside the laser line from relief that the line shows.

A facet of the wall, such as a crystal of rust or a drop, reflects stray light of the laser to the camera
though the line lies some millimetres before or behind it. Taken for the line, it is triangulated onto the
laser sheet, along the camera's line of sight. From ring to ring the line passes on along the pipe, and the
spot stays: where the lines of sight meet the smooth wall, its light is always at the same place, whereas the
light of relief moves on with the line. Such a spot is also brighter than the line beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples, Trajectory
from pipeline.geometry.axis import distance_along, roll_at, to_pipe
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from stages.defects.relief import Relief
from stages.defects.segment import Region

# Rings up to 4 mm beyond a finding are compared: farther from the line a spot shines too weakly (chosen).
_REACH_MM = 4.0
# Light stays at its place if it moves by less than a quarter of the way of the line, which has to be .5 mm:
# on relief that would be a flank as steep as the line of sight itself, so that it could hardly be seen. Rings
# more than 2.5 mm apart do not show one spot, nor do places more than 1 mm apart around the pipe (chosen): of
# many rings with glints all over them, two would agree by chance.
_STAYS, _LEAST_WAY_MM, _FARTHEST_MM, _ASIDE_MM = 0.25, 0.5, 2.5, 1.0
# A sample departs by a quarter of the finding's depth and by half of its ring's largest departure there.
# Three samples of a ring make a spot.
_DEPARTS, _TOP, _LEAST_SAMPLES = 0.25, 0.5, 3
# A spot is twice as bright as the line beside it. Paint and rust vary by less over so few degrees (chosen);
# the line is no brighter on the flank of a defect.
_BRIGHTER = 2.0


@dataclass(frozen=True)
class _Light:
    """What departs from the smooth wall in one ring.

    Attributes
    ----------
    frame : int
    line_mm : float
        Distance along the pipe at which the laser sheet meets the smooth wall there.
    place_mm, around_mm : float
        Distance along and around the pipe at which the lines of sight meet the smooth wall.
    brightness : float
        Over that of the line beside it in the same ring; NaN where no line is seen beside it.
    """

    frame: int
    line_mm: float
    place_mm: float
    around_mm: float
    brightness: float

    def stays_with(self, other: _Light) -> bool:
        """Whether both are light of one place of the wall, and brighter than a line."""
        way = abs(self.line_mm - other.line_mm)
        bright = max(np.nan_to_num([self.brightness, other.brightness])) > _BRIGHTER
        beside = abs(self.around_mm - other.around_mm) < _ASIDE_MM
        stays = abs(self.place_mm - other.place_mm) < _STAYS * way
        return bool(bright and beside and stays and _LEAST_WAY_MM < way < _FARTHEST_MM)


def frames_with_spots(
    region: Region, depth_mm: float, relief: Relief, rings: RingSamples, probe: Probe, motion: Trajectory
) -> list[int]:
    """Return the frames whose rings show a spot in a region that stays in place as the line moves.

    ``rings`` are all rings with their rejected samples, which may show the spot farther from the line; the
    rows of ``region`` count from the first row of ``relief``. ``depth_mm`` is the finding's.
    """
    if region.all_round:
        return []
    s = relief.distance_mm[region.row : region.row + len(region.mask)]
    index = np.flatnonzero(np.isin(motion.frame, rings.frame))
    line = distance_along(motion.axis, motion.T_pc[index]) + probe.laser.baseline_mm
    near = index[(line > s[0] - _REACH_MM) & (line < s[-1] + _REACH_MM)]
    looked = _Looked(region, relief, _DEPARTS * abs(depth_mm), rings, probe, motion)
    lights = [light for k in near if (light := looked.light_in(int(k))) is not None]
    return [one.frame for one in lights if any(one.stays_with(other) for other in lights)]


@dataclass(frozen=True)
class _Looked:
    """A region of the wall, and what its rings are read with; ``departs_mm`` from the smooth wall."""

    region: Region
    relief: Relief
    departs_mm: float
    rings: RingSamples
    probe: Probe
    motion: Trajectory

    def light_in(self, k: int) -> _Light | None:
        """Return the light of the ring in the ``k``-th pose that departs from the wall in the region."""
        ring = int(np.searchsorted(self.rings.frame, self.motion.frame[k]))
        T_pc, axis = self.motion.T_pc[k], self.motion.axis
        camera_mm = distance_along(axis, T_pc[None])
        off_middle, half = self._around(self.rings.azimuth_rad + roll_at(axis, camera_mm, T_pc[None])[0])
        seen = np.isfinite(self.rings.radius_px[ring]) & (np.abs(off_middle) <= half)
        if seen.sum() < _LEAST_SAMPLES:
            return None
        uv, amplitude = self.rings.pixels_of(ring)[seen], self.rings.amplitude[ring]
        s, _, radius = to_pipe(axis, transform(T_pc, self.probe.triangulate(uv)))
        wall = self._wall_mm()
        away = np.abs(radius - wall)
        off = away > max(self.departs_mm, _TOP * away.max())
        if off.sum() < _LEAST_SAMPLES:
            return None
        beside = (np.abs(off_middle) > half) & (np.abs(off_middle) <= 2 * half) & self.rings.valid[ring]
        line = np.median(amplitude[beside]) if beside.any() else np.nan
        # The camera is close to the axis: along a line of sight, distance grows as the radius does.
        place = camera_mm[0] + (s - camera_mm[0]) * wall / radius
        return _Light(
            frame=int(self.motion.frame[k]),
            line_mm=float(np.median(s)),
            place_mm=float(np.median(place[off])),
            around_mm=float(wall * np.median(off_middle[seen][off])),
            brightness=float(np.median(amplitude[seen][off]) / line),
        )

    def _around(self, azimuth_rad: Float) -> tuple[Float, float]:
        """Return azimuths (n,) relative to the middle of the region's columns, and half their width, rad."""
        step = float(self.relief.azimuth_rad[1] - self.relief.azimuth_rad[0])
        half = self.region.mask.shape[1] * step / 2
        middle = self.relief.azimuth_rad[0] + self.region.column * step + half
        return np.asarray(np.angle(np.exp(1j * (azimuth_rad - middle)))), half

    def _wall_mm(self) -> float:
        """Return the radius of the smooth wall in the middle of the region, mm."""
        rows, columns = self.region.mask.shape
        middle = np.array([self.region.row + rows // 2]), np.array([self.region.column + columns // 2])
        return float(self.relief.shape_at(*(m.astype(float) for m in middle))[0])
