"""The stage premises compares a recording's tables with its pictures before any stage relies on them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field, field_validator

from pipeline.arrays import Bool, Float, Int
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import FrameTable, Illumination, Recording
from pipeline.recording.checks import CheckedFrames, withheld_frames
from pipeline.recording.one_field import OneField
from stages.premises.backwards import runs_forwards
from stages.premises.changes import (
    Changes,
    LeftOut,
    interlaced,
    refuse_or_warn_of_interlacing,
    refuse_unmended,
    warn_of_frames,
)
from stages.premises.clock import ClockJump, clock_jumps, warn_of_clock, without_jumps, without_stretch
from stages.premises.cuts import cuts, warn_of_cuts
from stages.premises.labels import (
    Labels,
    labels_shown,
    light_of_pictures,
    rows_by_light,
    stated_labels,
    stated_lights,
    whole_table,
)
from stages.premises.light import Light, rhythm_of
from stages.premises.losses import Steps, row_times, rows_by_motion, steps_of_wall, sway_of_line
from stages.premises.order import behind_the_end, off_the_pipe, out_of_order
from stages.premises.pictures import CLOSED, Pictures, examine_pictures
from stages.premises.repeats import best_followed, copies, rows_that_follow_encoder
from stages.premises.scale import (
    check_diameter,
    encoder_factor,
    in_mm,
    radius_along_mm,
    radius_seen_mm,
    rings_seen_mm,
    warn_of_oval,
)
from stages.premises.stays import find_static_places
from stages.premises.zoom import Zoom, warn_of_zooms, without_zooms


class PremisesParameters(Parameters):
    """Parameters of the premises."""

    mend: bool = Field(
        True, description="correct lights and times of frames that the pictures contradict; false: stop"
    )
    withhold: int = Field(
        0,
        ge=0,
        le=1000,
        description="of each light every nth frame is withheld from all measurement, so that boresight "
        "twin can compare it with what the run predicts; 0: none",
    )

    @field_validator("withhold")
    @classmethod
    def _leave_some(cls, every: int) -> int:
        if every == 1:
            raise ValueError("1 would withhold every frame; give 0 for none, or 2 or more")
        return every


def check_premises(
    recording: Recording, probe: Probe, parameters: PremisesParameters, context: Context
) -> CheckedFrames:
    """Compare stated lights, times, diameter and encoder with the pictures; correct errors, and warn of them.

    Raises
    ------
    UnusableError
        When a statement is wrong and cannot be corrected, or when ``parameters.mend`` forbids it.
    """
    recording, pictures, combed = _progressive(recording, probe, parameters, context)
    seen = _seen(recording, probe, pictures, context)
    found = _matched(recording, probe, seen)
    changes, left_out = found.changes, found.left_out.any
    refuse_unmended(changes, parameters.mend)
    factor = _compared(recording, probe, seen, found, context)
    keep = np.concatenate([[True], np.diff(changes.row) > 0]) & ~left_out
    withheld = withheld_frames(changes.label[keep], parameters.withhold)
    context.report("frames withheld from measurement", int(withheld.sum()), "frames")
    # The pictures of the line between the last wall before a cut and the first behind it may lie behind it.
    behind = recording.frames.frame[pictures.partner[found.cut] + 1]
    return CheckedFrames(
        recording.frames.frame[keep], changes.time_s[keep], changes.label[keep], factor,
        int(changes.relabelled.sum()), int(changes.retimed.sum()),
        withheld if withheld.any() else None, seen.stays, combed, tuple(behind.tolist()),
        behind_the_end(pictures, seen.outside, seen.light),
    )  # fmt: skip


@dataclass(frozen=True)
class _Seen:
    """What the pictures of a recording show.

    ``light`` (F,) is the `Light` of every picture; ``in_order`` (F,) is the same, but unknown for pictures
    outside the pipe or out of order; ``shown`` (F,) is ``in_order``, or the stated lights if the pictures do
    not show two lights. ``outside`` and ``astray`` (F,) are as in `LeftOut`. ``stays`` (h, w) marks places
    of the picture where something stays while the wall moves.
    """

    pictures: Pictures
    light: Int
    in_order: Int
    shown: Int
    outside: Bool
    astray: Bool
    stays: Bool | None


@dataclass(frozen=True)
class _Matched:
    """Corrected rows, lights and times of the pictures, and the corrections."""

    changes: Changes
    left_out: LeftOut
    cut: Int
    zoomed: list[Zoom]
    jumps: list[ClockJump]
    steps: Steps
    rings_mm: Float
    radius_mm: float
    forwards: bool


def _seen(recording: Recording, probe: Probe, pictures: Pictures, context: Context) -> _Seen:
    frames = recording.frames
    light, stated = light_of_pictures(frames, pictures), stated_lights(frames.illumination)
    outside = off_the_pipe(pictures, light if np.any(light != Light.UNKNOWN) else stated)
    astray = out_of_order(pictures, np.where(outside, Light.UNKNOWN, light))
    in_order = np.where(astray | outside, Light.UNKNOWN, light)
    shown = in_order if np.any(in_order == Light.WALL) else stated
    closed = pictures.line_px[pictures.closed > CLOSED]
    line_px = np.median(closed, axis=0).astype(float) if len(closed) else None
    stays = find_static_places(recording, probe, frames.frame[shown == Light.WALL], context, line_px)
    if stays is not None:
        pictures = examine_pictures(recording, probe, context, stays)
    return _Seen(pictures, light, in_order, shown, outside, astray, stays)


def _rings_seen(pictures: Pictures, label: Labels, probe: Probe) -> tuple[Pictures, Float]:
    """Return the pictures and rings' radii, mm, without lines that close where the laser is off.

    Such a line is a joint or a weld.
    """
    lines = replace(pictures, closed=np.where(label == Illumination.LED.value, 0.0, pictures.closed))
    return lines, rings_seen_mm(lines, probe)


def _matched(recording: Recording, probe: Probe, seen: _Seen) -> _Matched:
    """Find the row of every picture by the lights, then by the motion of the wall, then the clock's jumps."""
    table, pictures, light, encoder = whole_table(recording), seen.pictures, seen.in_order, recording.encoder
    alignment = rows_by_light(recording.frames, table, pictures, light)
    copy = _copies(recording, table, pictures, light, alignment.row)
    label = np.where(
        copy, stated_labels(table, alignment.row), labels_shown(table, alignment, light, pictures)
    )
    steps, zoomed = without_zooms(steps_of_wall(pictures, seen.shown, copy), pictures, light)
    sway = sway_of_line(pictures, light)
    again = copy | (np.diff(alignment.row, prepend=-1) < 1)
    first = rows_that_follow_encoder(alignment.row, again, table, steps, encoder)
    lines, rings_mm = _rings_seen(pictures, label, probe)
    along_mm, radius_mm = radius_along_mm(lines, rings_mm), radius_seen_mm(rings_mm)
    forwards = runs_forwards(encoder, time_s := row_times(table, first), steps)
    one_bore, read = recording.kind != "gauge", in_mm(encoder, time_s, steps, radius_mm)
    row = rows_by_motion(first, steps, rhythm_of(light), table, read, sway, along_mm, one_bore)
    # A crawler that moves in steps loses no pictures.
    row = best_followed((row, first), table, steps, encoder)
    stated_s = without_stretch(row_times(table, row), row, table, recording.frame_rate)
    jumps = clock_jumps(stated_s, steps, encoder)
    changes = Changes(recording.frames, label, row, without_jumps(stated_s, jumps))
    left_out = LeftOut(seen.outside, seen.astray, again & (np.diff(row, prepend=-1) > 0))
    cut = cuts(pictures, seen.shown, left_out.any, changes.time_s)
    return _Matched(changes, left_out, cut, zoomed, jumps, steps, rings_mm, radius_mm, forwards)


def _compared(recording: Recording, probe: Probe, seen: _Seen, found: _Matched, context: Context) -> float:
    """Warn of every wrong statement; return the factor by which the encoder's readings are multiplied."""
    frame, pictures, changes = recording.frames.frame, seen.pictures, found.changes
    shown = np.where(seen.outside & np.any(seen.light != Light.UNKNOWN), Light.WALL, seen.light)
    warn_of_frames(changes, pictures, shown, whole_table(recording), context)
    found.left_out.warn(frame, context)
    warn_of_cuts(found.cut, pictures, frame, context)
    warn_of_zooms(found.zoomed, frame, context)
    check_diameter(found.radius_mm, recording.pipe, probe.lighting.radius_mm, context)
    warn_of_oval(found.rings_mm, context)
    factor = encoder_factor(recording, changes.time_s, found.steps, found.radius_mm, found.forwards, context)
    warn_of_clock(found.jumps, changes.time_s, recording, context)
    _report(pictures, found.radius_mm, changes, context)
    return factor


def _progressive(
    recording: Recording, probe: Probe, parameters: PremisesParameters, context: Context
) -> tuple[Recording, Pictures, bool]:
    """Return recording, pictures, and whether they are interlaced; if so, both contain even rows only."""
    pictures = examine_pictures(recording, probe, context)
    if not interlaced(pictures):
        return recording, pictures, False
    refuse_or_warn_of_interlacing(parameters.mend, context)
    recording = replace(recording, source=OneField(recording.source))
    return recording, examine_pictures(recording, probe, context), True


def _copies(recording: Recording, table: FrameTable, pictures: Pictures, light: Int, row: Int) -> Bool:
    """Return which pictures (F,) repeat an earlier one."""
    stated, time_s = stated_lights(stated_labels(table, row)), row_times(table, row)
    return copies(pictures, light, stated, row, time_s, recording.encoder)


def _report(pictures: Pictures, radius_mm: float, changes: Changes, context: Context) -> None:
    context.report("pictures examined", int(pictures.seen.sum()), "frames")
    context.report("frames whose light was corrected", int(changes.relabelled.sum()), "frames")
    context.report("frames whose time was corrected", int(changes.retimed.sum()), "frames")
    context.report("pipe radius by ring and stated probe", radius_mm, "mm")


PREMISES = Stage(
    "premises", "43", PremisesParameters, check_premises,
    "stated lights, times, encoder and diameter compared with the pictures and corrected",
)  # fmt: skip
