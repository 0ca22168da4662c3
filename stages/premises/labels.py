"""Find which light is on in every picture, from the pictures and the labels of frames.csv."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Int
from pipeline.errors import UnusableError
from pipeline.recording.base import FrameTable, Illumination, Recording
from stages.premises.light import Light, light_seen, look_the_same, pattern_breaks
from stages.premises.pictures import CLOSED, Pictures
from stages.premises.repeats import repeated, rows_of_repeats
from stages.premises.rows import Alignment, Lights, aligned

_LASER, _LED, _BOTH = Illumination.LASER.value, Illumination.LED.value, Illumination.BOTH.value
Labels = NDArray[np.str_]
# If all pictures look the same, the light that at least this share of the rows states is taken as true, and
# the other rows count as mistakes. If no light has such a share, the table is refused. As many of the bright
# pictures must show the line for the light to be one.
_MOST_ROWS = 2 / 3
# Lights that change more often than this from picture to picture are switched on purpose.
_SWITCHED = 0.1


def whole_table(recording: Recording) -> FrameTable:
    """Return the whole table of frames if its first rows are the pictures' frames, else only their rows."""
    frame, listed = recording.frames.frame, recording.listed
    whole = listed is not None and np.array_equal(listed.frame[: len(frame)], frame)
    return listed if whole and listed is not None else recording.frames


def stated_lights(illumination: Labels) -> Int:
    """Return the `Light` (F,) that each label states: the line alone, or the lit wall."""
    return np.where(illumination == _LASER, int(Light.LINE), int(Light.WALL))


def stated_labels(table: FrameTable, row: Int) -> Labels:
    """Return the label (F,) of the row of each picture; rows beyond the table count as its nearest."""
    return np.asarray(table.illumination[np.clip(row, 0, len(table.frame) - 1)])


def light_of_pictures(frames: FrameTable, pictures: Pictures) -> Int:
    """Return the `Light` (F,) of every picture.

    If all look the same although the table states two lights, the light of most rows is returned.

    Raises
    ------
    UnusableError
        When the table states one light and the pictures show two, or when it states two, neither of them in
        most rows, and all pictures look the same.
    """
    light, stated = _beside_line(frames, pictures), stated_lights(frames.illumination)
    _refuse_one_light(frames, stated, light)
    line, wall = stated == Light.LINE, stated == Light.WALL
    two = line.any() and wall.any()
    if np.any(light != Light.UNKNOWN) or not (two and look_the_same(pictures, line, wall)):
        return light
    if max(line.mean(), wall.mean()) < _MOST_ROWS:
        raise UnusableError(
            "premises",
            f"frames.csv states two lights, {line.sum()} times laser and {wall.sum()} times led or both, but "
            "all pictures look the same",
            hint="state in frames.csv which light was on in each frame",
        )
    return np.where(pictures.seen, Light.LINE if line.mean() > 0.5 else Light.WALL, Light.UNKNOWN)


def _beside_line(frames: FrameTable, pictures: Pictures) -> Int:
    """Return the `Light` (F,) that pictures show; unknown if only their brightness changes.

    Where the table states laser and LEDs in all, and bright pictures show the line as dark ones do, they are
    not of another light: the exposure has changed, or the light flickers.
    """
    light = light_seen(pictures)
    wall = light == Light.WALL
    alike = wall.any() and np.mean(pictures.closed[wall] > CLOSED) > _MOST_ROWS
    one = alike and bool(np.all(frames.illumination == _BOTH))
    return np.full_like(light, Light.UNKNOWN) if one else light


def _refuse_one_light(frames: FrameTable, stated: Int, light: Int) -> None:
    """Refuse a table that states a single light, where the pictures show two that alternate."""
    names, known = np.unique(frames.illumination), light[light != Light.UNKNOWN]
    if len(names) != 1 or names[0] == _BOTH or not known.size or np.mean(np.diff(known) != 0) < _SWITCHED:
        return
    wrong = frames.frame[(light != Light.UNKNOWN) & (light != stated)]
    other = "the lit wall" if names[0] == _LASER else "a laser line in the dark"
    raise UnusableError(
        "premises",
        f"frames.csv says {names[0]} of every frame, but {len(wrong)} pictures show {other}",
        frames=wrong.tolist(),
        hint="state in frames.csv which light was on in each frame: laser, led or both",
    )


def rows_by_light(frames: FrameTable, table: FrameTable, pictures: Pictures, light: Int) -> Alignment:
    """Return the row of each picture; with a single stated light, each picture has the row of its number."""
    rows, stated = np.arange(len(frames.frame)), stated_lights(table.illumination)
    wrong = (light != Light.UNKNOWN) & (light != stated[rows])
    if len(np.unique(stated)) < 2:
        lit = len(rows) > 2 and stated[0] == Light.WALL
        return Alignment(rows_of_repeats(rows, pictures) if lit else rows, np.zeros(len(rows), bool))
    if not wrong.any():
        return Alignment(rows, np.zeros(len(rows), bool))
    again = repeated(pictures, light)
    known_light = np.where(again, Light.UNKNOWN, light)  # a repeated picture does not show its own light
    return aligned(Lights(known_light, stated, pattern_breaks(light), again))


def labels_shown(table: FrameTable, alignment: Alignment, light: Int, pictures: Pictures) -> Labels:
    """Return the illumination (F,) of every picture as it shows it; if it shows none, that of its row."""
    stated = stated_labels(table, alignment.row)
    led, both = stated == _LED, stated == _BOTH
    wall = _LED if led.sum() >= both.sum() else _BOTH
    if led.any() and both.any() and look_the_same(pictures, led, both):
        stated = np.where(stated == _LASER, _LASER, wall)
    believed = np.where(alignment.swapped, np.where(stated == _LASER, wall, _LASER), stated)
    if len(np.unique(stated_lights(table.illumination))) < 2:
        return np.asarray(believed)
    shown = np.where(light == Light.LINE, _LASER, np.where(believed == _LASER, wall, believed))
    return np.asarray(np.where(light == Light.UNKNOWN, believed, shown))
