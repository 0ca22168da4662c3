"""Frames withheld from measurement: which they are, and that no stage receives their pictures."""

import numpy as np
import pytest

from pipeline.recording.base import FrameTable, Illumination, PipeFacts, Recording
from pipeline.recording.checks import WITHHELD, CheckedFrames, withheld_frames
from stages.premises import PremisesParameters


def _recording(table):
    return Recording("r", "inspection", None, table, None, PipeFacts(100.0), 30.0, None, None, "")


def test_every_tenth_frame_of_each_light_is_withheld_and_its_neighbours_are_not():
    label = np.array(["laser", "led"] * 100)
    withheld = withheld_frames(label, 10)
    assert [withheld[label == kind].sum() for kind in ("laser", "led")] == [10, 10]
    assert not np.any(withheld[1:] & withheld[:-1])


@pytest.mark.parametrize("label", [["both"] * 30, ["laser"] * 30])
def test_frames_are_withheld_in_a_recording_with_one_light(label):
    assert withheld_frames(np.array(label), 10).sum() == 3


def test_withholding_every_frame_is_refused():
    with pytest.raises(ValueError, match="1 would withhold every frame"):
        PremisesParameters(withhold=1)


def test_by_default_nothing_is_withheld():
    assert not withheld_frames(np.array(["laser", "led"] * 20), 0).any()


def test_stages_receive_no_withheld_pictures_but_poses_include_their_times():
    label = np.array(["laser", "led"] * 20)
    table = FrameTable(np.arange(40), np.arange(40) / 30, label)
    checked = CheckedFrames(table.frame, table.time_s, label, withheld=withheld_frames(label, 10))
    seen = checked.applied_to(_recording(table)).frames
    given = seen.of(Illumination.LASER, Illumination.LED, Illumination.BOTH)
    assert not set(given) & set(table.frame[checked.withheld])
    assert len(seen.frame) == 40
    assert (seen.illumination == WITHHELD).sum() == checked.withheld.sum() == 4
