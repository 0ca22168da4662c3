"""Accumulation: computes a cloud and the wall's radius over distance and azimuth from rings and trajectory.

The effect of the instrument's uncertainty on the radius is common to all rings: it does not average out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydantic import Field

from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory, Wall
from pipeline.artefacts.moved_back import kept_by_roll
from pipeline.artefacts.wall_map import FixedPlace, FixedToProbe
from pipeline.errors import UnusableError
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
from stages.accumulate.survey import RingsOnWall, RingSurvey, in_steady_pictures, survey_of
from stages.accumulate.systematic import CalibrationSpread, Systematic, calibration_spread
from stages.accumulate.unmeasured import warn_of_unmeasured

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
    systematic = _systematic(found, on_wall, survey, grid, parameters.largest_gap_mm, context)
    held = held_in(rings, survey, trajectory.radius_mm)
    wall = empty_wall(grid, survey, trajectory.axis, systematic.fixed, context.scratch)
    radius_map = replace(wall.radius_map, displaced_mm=systematic.displaced_mm)
    wall = replace(wall, held=held, radius_map=radius_map)
    smoothing_mm, gap_mm = parameters.smoothing_mm, parameters.largest_gap_mm
    stretches = cut_stretches(grid, survey, smoothing_mm, gap_mm)
    for done, stretch in enumerate(stretches, 1):
        sigma = systematic.on(grid, slice(stretch.from_row, stretch.to_row))
        part = map_of(stretch, on_wall, survey, grid, sigma, smoothing_mm, gap_mm, held)
        fill(wall, stretch, part, on_wall, survey)
        context.progress(done, len(stretches))
    _judge_radii(wall, trajectory, context)
    _report(context, wall, systematic.instrument)
    warn_of_displaced(trajectory, wall, context)
    _warn_of_fixed(systematic.fixed, context)
    warn_of_unmeasured(wall.radius_map, trajectory.radius_mm, gap_mm, survey.middle_mm, context)
    return wall


def _systematic(
    probe: Probe, on_wall: RingsOnWall, survey: RingSurvey, grid: MapGrid, gap_mm: float, context: Context
) -> Systematic:
    """Return all systematic parts of the radius's σ."""
    rings, trajectory, scratch = on_wall.rings, on_wall.trajectory, context.scratch
    return Systematic(
        calibration_spread(probe, rings, trajectory, survey),
        displaced_on(grid, trajectory, rings.frame, survey),
        fixed_to_probe(survey, rings.frame, trajectory.radius_mm, grid, scratch),
        rival_on(grid, on_wall, survey),
        shared_on_wall(on_wall, grid, gap_mm, scratch),
    )


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
        "something on the window or fixed to the probe, or a groove, ridge or standing water along the pipe: "
        f"{seen}. The probe does not roll enough to decide. The departure is added to σ there, and "
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
    "30",
    AccumulateParameters,
    _wall_of_run,
    "point cloud and radius map around the pipe's own axis, with σ",
)
