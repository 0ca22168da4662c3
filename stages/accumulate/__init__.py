"""Accumulation: computes a cloud and the wall's radius over distance and azimuth from rings and trajectory.

The effect of the instrument's uncertainty on the radius is common to all rings: it does not average out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from pipeline.arrays import Float
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.artefacts.measured import RingPoints, RingSamples, RingValidity, Trajectory, Wall
from pipeline.artefacts.moved_back import kept_by_roll
from pipeline.artefacts.wall_map import FixedPlace, FixedToProbe
from pipeline.errors import UnusableError
from pipeline.geometry.axis import roll_at
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.pages import notation
from pipeline.recording.base import Recording
from stages.accumulate.displaced import displaced_on, warn_of_displaced
from stages.accumulate.fixed import fixed_to_probe
from stages.accumulate.grid import MapGrid, map_grid
from stages.accumulate.held import held_in, warn_of_held
from stages.accumulate.rival import rival_on
from stages.accumulate.shared_errors import shared_on_wall, warn_of_left_out
from stages.accumulate.stretch import cut_stretches, empty_wall, fill, map_of
from stages.accumulate.survey import RingsOnWall, RingSurvey, in_steady_pictures, nearest, survey_of
from stages.accumulate.unmeasured import warn_of_unmeasured

# Azimuths, 5° apart: the instrument's errors are harmonics up to the fourth, and linear between nodes.
_AZIMUTHS = 72
# Rings for which the instrument's share is computed: at least so many, in long runs every 500th.
_RINGS, _EVERY = 24, 500


@dataclass(frozen=True)
class CalibrationSpread:
    """1 σ of the radius from the probe's covariance at some distances (K,), around the circle (K, 72)."""

    distance_mm: Float
    sigma_mm: Float

    def on(self, grid: MapGrid) -> Float:
        """Return the 1 σ (S, A): rows take the nearest distance, columns are interpolated."""
        rows = self.sigma_mm[nearest(self.distance_mm, grid.distance_mm)]
        wide = np.concatenate([rows, rows[:, :1]], 1)
        fine = (grid.azimuth_rad + np.pi) / (2 * np.pi / _AZIMUTHS)
        left = np.minimum(fine.astype(int), _AZIMUTHS - 1)
        part = fine - left
        return np.asarray(wide[:, left] * (1 - part) + wide[:, left + 1] * part)


def calibration_spread(
    probe: Probe, rings: RingSamples, trajectory: Trajectory, survey: RingSurvey
) -> CalibrationSpread:
    """Return the 1 σ of the radius from the instrument's uncertainty, computed for some rings.

    The first harmonic of each change is removed, because the pipe's axis follows the rings' centres.
    """
    azimuth = np.linspace(-np.pi, np.pi, _AZIMUTHS, endpoint=False)
    # Rings seen over less than 0.3 of the circle hardly determine the first harmonic to be removed (chosen).
    usable = np.flatnonzero(survey.seen > min(0.3, 0.99 * survey.seen.max()))
    count = min(len(usable), max(_RINGS, len(usable) // _EVERY))
    some = usable[np.unique(np.linspace(0, len(usable) - 1, count).astype(int))]
    index = np.searchsorted(trajectory.frame, rings.frame[some])
    roll = roll_at(trajectory.axis, survey.middle_mm[some], trajectory.T_pc[index])
    knock = trajectory.knock
    after = probe if knock is None else probe.after(knock)
    first = np.inf if knock is None else knock.frame
    probes = [probe if rings.frame[k] < first else after for k in some]
    profiles = [_around(p, rings, k, azimuth, t) for p, k, t in zip(probes, some, roll, strict=True)]
    drift = np.full(len(some), trajectory.radius_doubt * trajectory.radius_mm)
    if trajectory.image_scale_sigma is not None:
        by_scale = [_by_scale(probe, rings, k) for k in some]
        drift = np.hypot(drift, np.array(by_scale) * trajectory.image_scale_sigma[index])
    return CalibrationSpread(survey.middle_mm[some], np.hypot(np.stack(profiles), drift[:, None]))


def _by_scale(probe: Probe, rings: RingSamples, row: int) -> float:
    """Return the change of a ring's radius, mm, per relative change of the picture's scale."""
    outward = np.stack([np.cos(rings.azimuth_rad), np.sin(rings.azimuth_rad)], -1)
    radius_px = float(np.median(rings.radius_px[row][rings.valid[row]]))
    by_pixel = probe.triangulate_jacobian(rings.centre_px + radius_px * outward)[0][:, :2]
    return radius_px * float(np.mean(np.einsum("ai,aij,aj->a", outward, by_pixel, outward)))


def _around(probe: Probe, rings: RingSamples, row: int, azimuth_p: Float, roll: float) -> Float:
    """Return the 1 σ of the radius at azimuths of P (72,) for one ring."""
    azimuth_c = (azimuth_p - roll + np.pi) % (2 * np.pi) - np.pi
    valid = rings.validity[row] == RingValidity.VALID
    radius_px = float(np.median(rings.radius_px[row][valid]))
    outward = np.stack([np.cos(azimuth_c), np.sin(azimuth_c)], -1)
    by_parameters = probe.triangulate_jacobian(rings.centre_px + radius_px * outward)[1]
    change = np.einsum("ai,aip->ap", outward, by_parameters[:, :2])
    first = np.stack([np.cos(azimuth_c), np.sin(azimuth_c)], -1)
    change = change - first @ (first.T @ change) * (2 / len(azimuth_p))
    return np.asarray(np.sqrt(np.einsum("ap,pq,aq->a", change, probe.covariance, change)))


__all__ = ["ACCUMULATE", "AccumulateParameters", "accumulate_wall"]

# Number of rows from which the report's medians are computed.
_REPORTED_ROWS = 2000
# A branch, step or collapse may take half of the radius somewhere, not from most of a pipe. Not measured.
_IMPOSSIBLE, _MOST_IMPOSSIBLE = 0.5, 0.5
# Share from which such wall is reported. Chosen: a branch of half of the diameter in a metre of pipe has
# more.
_FEW_IMPOSSIBLE = 0.002
# Places fixed to the image that are warned of one by one; the largest first.
_LISTED_PLACES = 4


class AccumulateParameters(Parameters):
    """Parameters of the accumulate stage."""

    distance_step_mm: float = Field(0.5, ge=0.05, le=10, description="row spacing, mm, of the radius map")
    azimuth_samples: int = Field(720, ge=90, le=5760, description="columns of the radius map")
    smoothing_mm: float = Field(
        0.3,
        gt=0,
        le=10,
        description="smallest 1 σ, mm, of the kernel along distance; wider where rings are sparse",
    )
    largest_gap_mm: float = Field(
        3.0, gt=0, le=50, description="largest distance, mm, between rings that is bridged"
    )


def accumulate_wall(
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    trajectory: Trajectory,
    parameters: AccumulateParameters,
    context: Context,
) -> Wall:
    """Transform every ring into the pipe frame and estimate the wall's radius around the pipe's own axis.

    Raises
    ------
    UnusableError
        When no ring sample lies on the wall, or most of the wall is far from the pipe's radius.
    """
    found = probe.as_found_in(trajectory)
    kept = kept_by_roll(rings, trajectory)
    warn_of_left_out(rings, kept, context)
    rings = in_steady_pictures(kept, trajectory)
    on_wall = RingsOnWall(found, rings, points, trajectory)
    survey = survey_of(on_wall)
    if not survey.count.any():
        hint = "the report lists the rejected samples of the stage rings by reason; see the earlier warnings"
        raise UnusableError("accumulate", "no valid ring sample", hint=hint)
    grid = map_grid(survey, parameters.distance_step_mm, parameters.azimuth_samples)
    spread = calibration_spread(found, rings, trajectory, survey)
    shared = shared_on_wall(on_wall, grid, parameters.largest_gap_mm, context.scratch)
    rival = rival_on(grid, on_wall, survey)
    fixed = fixed_to_probe(survey, rings.frame, trajectory.radius_mm, grid, context.scratch)
    held = held_in(rings, survey, trajectory.radius_mm)
    wall = empty_wall(grid, survey, trajectory.axis, fixed, context.scratch)
    displaced = displaced_on(grid, trajectory, rings.frame, survey)
    radius_map = replace(wall.radius_map, displaced_mm=displaced)
    wall = replace(wall, held=held, radius_map=radius_map)
    smoothing_mm, gap_mm = parameters.smoothing_mm, parameters.largest_gap_mm
    stretches = cut_stretches(grid, survey, smoothing_mm, gap_mm)
    for done, stretch in enumerate(stretches, 1):
        rows = slice(stretch.from_row, stretch.to_row)
        local = displaced[rows, None]
        if fixed is not None:
            # What stays at a place of the image is a part of what displaces the picture.
            local = np.maximum(local, fixed.departure_mm[rows])
        systematic = np.hypot(spread.on(grid.rows(rows.start, rows.stop)), local)
        for more in (None if rival is None else rival[:, None], shared):
            if more is not None:
                systematic = np.hypot(systematic, more[rows])
        part = map_of(stretch, on_wall, survey, grid, systematic, smoothing_mm, gap_mm, held)
        fill(wall, stretch, part, on_wall, survey)
        context.progress(done, len(stretches))
    _judge_radii(wall, trajectory, context)
    _report(context, wall, spread)
    warn_of_displaced(trajectory, wall, context)
    _warn_of_fixed(fixed, context)
    warn_of_unmeasured(wall.radius_map, trajectory.radius_mm, gap_mm, survey.middle_mm, context)
    return wall


def _warn_of_fixed(fixed: FixedToProbe | None, context: Context) -> None:
    """Warn of departures that stay at one place of the image while the wall moves."""
    places = () if fixed is None else fixed.places
    context.report("departures of the line that stay in the image, not on the wall", len(places), "")
    for place in sorted(places, key=lambda p: -abs(p.departure_mm))[:_LISTED_PLACES]:
        context.warn(_fixed_in_words(place))


def _fixed_in_words(place: FixedPlace) -> str:
    seen = (
        f"at {notation.clock(float(clock_of_azimuth(place.azimuth_rad)))} in the picture, over "
        f"{np.degrees(place.width_rad):.0f}°, the line departs by {abs(place.departure_mm):.2f} mm "
        f"{'outward' if place.departure_mm > 0 else 'inward'} while {place.length_mm:.0f} mm of wall pass "
        f"(frames {place.frame_from} to {place.frame_to})"
    )
    if place.on_probe:
        return (
            f"something on the window or fixed to the probe: {seen}, and it does not follow the wall when "
            "the probe rolls. Its departure is added to σ there, and findings there are not counted. What to "
            "do: clean the window, look for scratches and reflections, record again"
        )
    return (
        f"something on the window or fixed to the probe, or a groove or ridge along the pipe: {seen}. The "
        "probe does not roll enough to decide. The departure is added to σ there, and "
        "findings there are not counted. What to do: clean the window and record again with the probe "
        "rolled by 30° or more"
    )


def _judge_radii(wall: Wall, trajectory: Trajectory, context: Context) -> None:
    """Warn of wall whose radius differs from the pipe's by half; end the run if half of the wall does."""
    rows = slice(None, None, max(len(wall.radius_map.distance_mm) // _REPORTED_ROWS, 1))
    radius = wall.radius_map.radius_mm[rows]
    known = radius[np.isfinite(radius)]
    impossible = np.abs(known - trajectory.radius_mm) > _IMPOSSIBLE * trajectory.radius_mm
    if known.size and _FEW_IMPOSSIBLE < impossible.mean() <= _MOST_IMPOSSIBLE:
        context.warn(
            f"{100 * impossible.mean():.1f} % of the wall lies more than {100 * _IMPOSSIBLE:.0f} % off the "
            f"pipe's radius of {trajectory.radius_mm:.4g} mm, from {known.min():.4g} to {known.max():.4g} "
            "mm: a branch, an open joint, or rings that were measured wrongly. What to do: look "
            "at the pictures there, and check the findings there before you use them"
        )
    if known.size and impossible.mean() > _MOST_IMPOSSIBLE:
        raise UnusableError(
            "accumulate",
            f"{100 * impossible.mean():.0f} % of the wall lies more than {100 * _IMPOSSIBLE:.0f} % off the "
            f"pipe's radius of {trajectory.radius_mm:.4g} mm, from {known.min():.4g} to {known.max():.4g} mm",
            limit=f"{100 * _MOST_IMPOSSIBLE:.0f} % of the wall",
            frames=trajectory.frame.tolist(),
            hint="see the warnings of premises and motion: times may not belong to the pictures",
        )


def _report(context: Context, wall: Wall, spread: CalibrationSpread) -> None:
    radius_map = wall.radius_map
    # Medians and means of some thousand rows are close enough to those of all.
    some = slice(None, None, max(len(radius_map.distance_mm) // _REPORTED_ROWS, 1))
    radius, random = radius_map.radius_mm[some], radius_map.sigma_random_mm[some]
    context.report("wall points", len(wall.cloud.frame), "")
    context.report("coverage", float(100 * np.isfinite(radius).mean()), "%")
    context.report("length of wall measured", float(np.ptp(radius_map.distance_mm)), "mm")
    context.report("mean radius", float(np.nanmean(radius)), "mm")
    context.report("1 σ of the radius, random, median", float(np.nanmedian(random)), "mm")
    context.report("1 σ of the radius, calibration, median", float(np.median(spread.sigma_mm)), "mm")


def _wall_of_run(
    recording: Recording,
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    trajectory: Trajectory,
    parameters: AccumulateParameters,
    context: Context,
) -> Wall:
    """Accumulate a run's wall, and warn of rings that share light, in words that fit its recording."""
    wall = accumulate_wall(probe, rings, points, trajectory, parameters, context)
    warn_of_held(wall.held, recording.predicted, context)
    return wall


ACCUMULATE = Stage(
    "accumulate",
    "27",
    AccumulateParameters,
    _wall_of_run,
    "point cloud and radius map around the pipe's own axis, with σ",
)
