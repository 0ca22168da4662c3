"""Steps of brightness on synthetic sums of frames: of the exposure or of one light, and what is none."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.instrument.probe import Lighting
from stages.twin import causes as of_time
from stages.twin.causes import _at_once_first, _rivals, causes
from stages.twin.cells import SECTORS, Fitted, Law
from tests.unit.frame_cells import AZIMUTH_DEG, FRAMES, RING, cells_with, found_in_cells, step_from


@pytest.mark.parametrize(
    ("lit", "line", "name"),
    [(0.2, 0.2, "exposure_step"), (0.2, 0.0, "lamp_step"), (0.0, -0.3, "laser_step")],
)
def test_a_step_is_attributed_to_the_exposure_or_to_one_light(lit, line, name):
    (step,) = found_in_cells(lit * step_from(8), line * step_from(8))
    assert (step.name, step.fixed_to) == (name, "time")
    assert step.place[0].value == 75
    assert step.parameters[0].value == pytest.approx(np.expm1(lit or line), abs=4 * step.parameters[0].sd)
    assert step.chi2_after < step.chi2_before


@pytest.mark.parametrize("azimuth_deg", [-170, -60, 10, 80])
def test_darker_wall_on_one_side_of_the_last_frames_is_not_a_step_of_the_laser(azimuth_deg):
    """Corrosion on one side that two frames at the end saw was reported as a laser 7 % darker."""
    away = np.abs((AZIMUTH_DEG - azimuth_deg + 180) % 360 - 180)
    wall = -0.17 * (away < 80) * (np.arange(FRAMES) >= FRAMES - 2)[:, None]
    assert not any("step" in m.name for seed in range(4) for m in found_in_cells(0.0, wall, seed))


def _of_line(change, predicted=1.0, hidden=0):
    """Return the names found in the line, with some sectors hidden, beside lit frames without a change."""
    cells = cells_with(np.zeros((FRAMES, SECTORS)) + change, 1000, of_photo=0.05)
    pixels = np.where(np.arange(SECTORS) < hidden, 30.0, cells.pixels)
    cells = replace(cells, pixels=pixels, predicted=cells.predicted * predicted)
    return [m.name for m in causes(cells_with(np.zeros((FRAMES, SECTORS))), cells, Lighting(), RING)[0]]


def test_a_step_is_found_though_half_of_the_picture_is_not_seen():
    """A half without usable sectors did not step, so that no step was reported."""
    assert _of_line(-0.3 * step_from(8), hidden=18) == ["laser_step"]
    assert _of_line(-0.3 * step_from(8), hidden=22) == ["laser_step or other_wall"]


def test_darker_wall_on_two_thirds_of_the_picture_is_not_a_step_of_the_laser():
    """In 2 of 3 cases it was one: the other third was compared with the mean, not with its opposite."""
    wall = -0.3 * (np.abs(AZIMUTH_DEG - 20) < 120) * step_from(FRAMES - 3)
    assert not any("step" in m.name for seed in range(3) for m in found_in_cells(0.0, wall, seed))


def test_a_step_of_the_laser_where_the_photo_steps_too_may_be_other_wall():
    """Wall darker all round from a frame on was reported with certainty as a laser that loses power."""
    random = np.random.default_rng(2)
    texture = np.exp(
        0.03 * random.standard_normal((FRAMES, 1)) + 0.1 * random.standard_normal((FRAMES, SECTORS))
    )
    assert _of_line(-0.3 * step_from(12), texture) == ["laser_step"]
    for wall in (-0.2, 0.3):
        assert _of_line(-0.3 * step_from(12), texture * np.exp(wall * step_from(12))) == [
            "laser_step or other_wall"
        ]


def test_the_sigma_of_a_step_is_right_beside_an_error_that_changes_slowly():
    inside = 0
    for phase in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        slow = 0.003 * np.sin(np.arange(FRAMES) / 2.5 + phase)[:, None]
        both = (cells_with(np.log(1.06) * step_from(8) + slow + np.zeros(SECTORS), k, 0.001) for k in (0, 1))
        (step,) = causes(*both, Lighting(), RING)[0]
        inside += abs(step.parameters[0].value - 0.06) < 2 * step.parameters[0].sd
    assert inside >= 11


@pytest.mark.parametrize(("better_by", "kept"), [(1.0, ["step"]), (40.0, ["led_dead", "step"])])
def test_a_side_that_should_darken_at_once_and_does_not_hides_no_step_that_fits_as_well(
    better_by, kept, monkeypatch
):
    """A step of exposure under both lights, 10 %, was missed: an LED fitted by a thousandth better."""
    fall = 100 + 10 * np.random.default_rng(3).standard_normal(FRAMES)
    step, led = (
        Fitted(Law(name, np.zeros((1, 1, 1)), np.zeros((1, 3))), 0, -0.1, 0.001, 1e-9, each, 1.0, 0.9)
        for name, each in (("step", fall), ("led_dead", fall[::-1] + better_by))
    )
    monkeypatch.setattr(of_time, "_at_once", lambda found, cells: found.law.name == "step")
    assert [f.law.name for f in _at_once_first([led, step], None)] == kept


@pytest.mark.parametrize(
    ("line", "name"),
    [(None, "exposure_step or lamp_step"), (-0.1, "exposure_step"), (0.0, "lamp_step")],
)
def test_a_step_that_fits_as_well_as_an_led_is_named_by_what_the_laser_frames_show(line, name):
    """It was a lamp's in any case: an exposure that stepped was told as "led_dead or lamp_step"."""
    law = Law("step", step_from(8)[None] + np.zeros((1, 1, SECTORS)), np.array([[8.0]]))
    step = Fitted(law, 0, -0.1, 0.002, 1e-9, np.ones(FRAMES), 2.0, 1.0)
    lit = cells_with(-0.1 * step_from(8))
    other = None if line is None else cells_with(line * step_from(8), 1)
    led = replace(step, law=Law("led_dead", law.columns, np.array([[0.3, 8.0, 0.17]])), size=0.8)
    assert _rivals(led, [led, step], lit, "LEDs", other) == [name]
