"""The reported number of frames with times of other rows is right, whatever else is wrong with the times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.recording.base import FrameTable
from stages.premises.changes import Changes, warn_of_frames
from stages.premises.light import Light
from stages.premises.pictures import Pictures
from tests.quiet import quiet_context

COUNT, JUMP = 40, 10
NUMBERS = np.arange(COUNT)
LOST, PUT_IN = 12, (20, 21)
ROWS = NUMBERS - np.searchsorted(PUT_IN, NUMBERS, "right")


def told(row: np.ndarray, jump_s: float) -> list[str]:
    """Return the warnings where frames belong to rows (F,), and a jump of the clock was removed."""
    light = np.array(["laser", "led"])[NUMBERS % 2]
    table = FrameTable(NUMBERS, NUMBERS / 30, light)
    time_s = row / 30 - jump_s * (NUMBERS >= JUMP)
    plain = np.ones(COUNT)
    pictures = Pictures(
        plain, plain, np.ones((COUNT, 1), np.float32), np.zeros(1), plain, NUMBERS - 2, plain, plain
    )
    warnings: list[str] = []
    shown = np.where(NUMBERS % 2, Light.WALL, Light.LINE)
    context = replace(quiet_context(), warn=warnings.append)
    warn_of_frames(Changes(table, light, row, time_s), pictures, shown, table, context)
    return warnings


@pytest.mark.parametrize("jump_s", [0.0, 5.0], ids=["steady clock", "the clock jumps"])
def test_after_inserted_pictures_the_right_number_of_frames_belongs_to_earlier_rows(jump_s: float) -> None:
    """With a jump of the clock before them, the frames in between were counted too."""
    (again,) = told(ROWS, jump_s)
    assert f"the {COUNT - 22} frames after them now have the times of earlier rows" in again


@pytest.mark.parametrize("jump_s", [0.0, 5.0], ids=["steady clock", "the clock jumps"])
def test_one_lost_and_two_inserted_pictures_are_both_reported(jump_s: float) -> None:
    """Only the lost one was, with all frames after it, although most of them belong to earlier rows."""
    lost, again = told(ROWS + (NUMBERS >= LOST), jump_s)
    assert f"The {PUT_IN[0] - LOST} frames after them now have the times and lights" in lost
    assert f"the {COUNT - 22} frames after them now have the times of earlier rows" in again
