"""What the terminal shows of a run: one bar for the whole, nothing unknown, and warnings that stay."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from pipeline.machine.display import ProgressDisplay
from pipeline.machine.outcome import WARNING, Number, StageOutcome, State


@pytest.fixture
def out():
    return StringIO()


@pytest.fixture
def console(out):
    return Console(file=out, force_terminal=True, width=100, color_system=None)


def shown(display):
    """Return the bars as they are shown."""
    paper = Console(file=StringIO(), width=100, color_system=None)
    paper.print(display._progress.get_renderable())
    return paper.file.getvalue()


def test_the_bar_of_the_whole_is_above_those_of_the_stages(console):
    with ProgressDisplay(console) as display:
        display.planned(4)
        display.started("rings")
        display.progressed("rings", 80, 160)
        lines = shown(display).splitlines()
        assert lines[0].startswith("whole run")
        assert "0 of 4 stages" in lines[0]
        assert lines[1].startswith("  rings")
        assert "80 of 160" in lines[1]
        assert display._progress.tasks[0].completed == pytest.approx(0.5)


@pytest.mark.parametrize("total", [None, 0])
def test_unknown_numbers_are_not_shown(console, total):
    with ProgressDisplay(console) as display:
        display.planned(4)
        display.started("rings")
        if total is not None:
            display.progressed("rings", 0, total)
        text = shown(display)
    assert "?" not in text
    assert "-:--" not in text
    assert "working" in text


def test_before_the_first_stage_and_after_the_last_there_is_a_moving_bar(console):
    with ProgressDisplay(console) as display:
        assert "starting" in shown(display)
        display.planned(1)
        display.started("rings")
        display.ended(StageOutcome("rings", "1", "", State.COMPLETED, 1.0))
        assert "writing files" in shown(display)


@pytest.mark.parametrize("state", [State.UNUSABLE, State.CANCELLED])
def test_a_run_that_ends_early_is_called_stopped_and_its_warnings_stay(console, out, state):
    with ProgressDisplay(console) as display:
        display.planned(2)
        display.ended(StageOutcome("rings", "1", "", state, 1.0, (Number(WARNING, "10 of 160 frames"),)))
    assert "stopped" in out.getvalue()
    assert state.value not in out.getvalue()
    assert display.warnings == ["rings: 10 of 160 frames"]


@pytest.mark.parametrize("at_once", [True, False])
def test_a_warning_is_printed_by_the_display_or_left_to_the_caller(console, out, at_once):
    with ProgressDisplay(console, warn_at_once=at_once) as display:
        display.planned(2)
        display.ended(StageOutcome("rings", "1", "", State.COMPLETED, 1.0, (Number(WARNING, "10 of 160"),)))
    assert out.getvalue().count("10 of 160") == at_once
    assert out.getvalue().count("warnings: 1") == (not at_once)
