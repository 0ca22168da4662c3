"""Tell a spot of the wall that shines beside the laser line from relief that the line shows.

A facet of the wall, such as a crystal of rust or a drop, reflects stray light of the laser to the camera
though the line lies some millimetres before or behind it. Taken for the line, it is triangulated onto the
laser sheet, along the camera's line of sight. From ring to ring the line passes on along the pipe, and the
spot stays: where the lines of sight meet the smooth wall, its light is always at the same place, whereas the
light of relief moves on with the line. Such a spot is also brighter than the line beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.geometry.axis import roll_at, to_pipe
from pipeline.geometry.rigid import transform
from stages.defects.parallax import LitPictures
from stages.defects.relief import Relief
from stages.defects.segment import Region

# Rings up to 4 mm beyond a finding are compared, and light up to 4 mm from the line: farther off, a spot
# shines too weakly (chosen).
_REACH_MM = 4.0
# Light stays at its place if it moves by less than a quarter of the way of the line, which has to be .5 mm:
# on relief that would be a flank as steep as the line of sight itself, so that it could hardly be seen. Rings
# more than 2.5 mm apart do not show one spot, nor do places more than 1 mm apart around the pipe (chosen): of
# many rings with glints all over them, two would agree by chance.
_STAYS, _LEAST_WAY_MM, _FARTHEST_MM, _ASIDE_MM = 0.25, 0.5, 2.5, 1.0
# A sample departs by a quarter of the finding's depth and by half of its ring's largest departure there.
# Three samples of a ring make a spot.
_DEPARTS, _TOP, _LEAST_SAMPLES = 0.25, 0.5, 3
# A spot is twice as bright as the line beside it, in as many samples as the spot itself has. Paint and rust
# vary by less over so few degrees (chosen); the line is no brighter on the flank of a defect.
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


def frames_with_spots(
    region: Region, depth_mm: float, relief: Relief, rings: RingSamples, pictures: LitPictures
) -> list[int]:
    """Return the frames whose rings show a spot in a region that stays in place as the line moves.

    ``rings`` are all rings with their rejected samples, which may show the spot farther from the line; the
    rows of ``region`` count from the first row of ``relief``. ``depth_mm`` is the finding's.
    """
    if region.all_round:
        return []
    s = relief.distance_mm[region.row : region.row + len(region.mask)]
    index = np.flatnonzero(np.isin(pictures.motion.frame, rings.frame))
    line = pictures.line_mm[index]
    near = (line > s[0] - _REACH_MM) & (line < s[-1] + _REACH_MM)
    looked = _Looked(region, relief, _DEPARTS * abs(depth_mm), rings, pictures)
    walls = looked.wall_mm(line[near])
    seen = (looked.light_in(int(k), float(wall)) for k, wall in zip(index[near], walls, strict=True))
    return _staying([light for light in seen if light is not None])


def _staying(lights: Sequence[_Light]) -> list[int]:
    """Return the frames of lights that are of one place of the wall with another, and brighter than a line.

    Only lights near each other are compared: of a finding as long as the pipe there are very many.
    """
    line, place, around = (
        np.array([getattr(light, f"{k}_mm") for light in lights]) for k in ("line", "place", "around")
    )
    bright = np.array([light.brightness for light in lights]) > _BRIGHTER
    order = np.argsort(line)
    out = []
    for k in order:
        first, last = np.searchsorted(line, line[k] + _FARTHEST_MM * np.array([-1, 1]), sorter=order)
        others = order[first:last]
        way = np.abs(line[others] - line[k])
        stays = np.abs(place[others] - place[k]) < _STAYS * way
        beside = np.abs(around[others] - around[k]) < _ASIDE_MM
        far_enough = (way > _LEAST_WAY_MM) & (way < _FARTHEST_MM)
        if (stays & beside & far_enough & (bright[others] | bright[k])).any():
            out.append(lights[k].frame)
    return sorted(out)


@dataclass(frozen=True)
class _Looked:
    """A region of the wall, and what its rings are read with; ``departs_mm`` from the smooth wall."""

    region: Region
    relief: Relief
    departs_mm: float
    rings: RingSamples
    pictures: LitPictures

    def light_in(self, k: int, wall: float) -> _Light | None:
        """Return the light of the ring in the ``k``-th pose that departs from the wall in the region.

        ``wall`` is the smooth wall's radius there, mm.
        """
        motion, probe = self.pictures.motion, self.pictures.probe
        ring = int(np.searchsorted(self.rings.frame, motion.frame[k]))
        T_pc, axis = motion.T_pc[k], motion.axis
        camera_mm = self.pictures.line_mm[k : k + 1] - probe.laser.baseline_mm
        off_middle, half = self._around(self.rings.azimuth_rad + roll_at(axis, camera_mm, T_pc[None])[0])
        seen = np.flatnonzero(np.isfinite(self.rings.radius_px[ring]) & (np.abs(off_middle) <= half))
        xyz_c = probe.triangulate(self.rings.pixels_of(ring)[seen])
        s, _, radius = to_pipe(axis, transform(T_pc, xyz_c))
        meets = np.isfinite(s)  # beside the laser sheet, a rejected sample may be anything
        if meets.sum() < _LEAST_SAMPLES:
            return None
        line_mm = float(np.median(s[meets]))
        # The camera is close to the axis: along a line of sight, distance grows as the radius does.
        place = camera_mm[0] + (s - camera_mm[0]) * wall / radius
        away = np.where(np.abs(place - line_mm) < _REACH_MM, np.abs(radius - wall), 0.0)
        off = away > max(self.departs_mm, _TOP * away.max())
        if off.sum() < _LEAST_SAMPLES:
            return None
        spot, line = seen[off], self.rings.validity[ring] == RingValidity.VALID
        line[seen[away > self.departs_mm]] = False  # the spot, and its edges, which depart less
        line &= np.abs(off_middle) <= 2 * half
        return _Light(
            frame=int(motion.frame[k]),
            line_mm=line_mm,
            place_mm=float(np.median(place[off])),
            around_mm=wall * float(np.median(off_middle[spot])),
            brightness=_times_as_bright(self.rings.amplitude[ring], spot, line, off_middle),
        )

    def _around(self, azimuth_rad: Float) -> tuple[Float, float]:
        """Return azimuths (n,) relative to the middle of the region's columns, and half their width, rad."""
        step = float(self.relief.azimuth_rad[1] - self.relief.azimuth_rad[0])
        half = self.region.mask.shape[1] * step / 2
        middle = self.relief.azimuth_rad[0] + self.region.column * step + half
        return np.asarray(np.angle(np.exp(1j * (azimuth_rad - middle)))), half

    def wall_mm(self, line_mm: Float) -> Float:
        """Return the radius (n,), mm, of the smooth wall at lines (n,), in the middle of the columns."""
        row = (line_mm - self.relief.distance_mm[0]) / self.relief.cell_mm[0]
        column = float(self.region.column + self.region.mask.shape[1] // 2)
        return self.relief.shape_at(row, np.full_like(row, column))


def _times_as_bright(amplitude: Float32, spot: Int, line: Bool, azimuth_rad: Float) -> float:
    """Return a spot's brightness over that of the nearest samples of the ``line`` (A,), as many as it has.

    NaN if no line is seen beside it.
    """
    away = np.abs(azimuth_rad - np.median(azimuth_rad[spot]))
    beside = np.argsort(np.where(line, away, np.inf), kind="stable")[: min(len(spot), int(line.sum()))]
    return float(np.median(amplitude[spot]) / np.median(amplitude[beside])) if len(beside) else np.nan
