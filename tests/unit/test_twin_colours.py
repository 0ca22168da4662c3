"""Whether a colour that changes over the run is told from coloured wall and from noise."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import stages.twin.colours as colours
from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.recording.base import Illumination
from stages.twin.colours import beside_colour, colour_over_run, few_lit
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring

SHAPE, FRAMES, STEP_MM, SHEET_MM, LENGTH_MM = (160, 240), 8, 8.0, 23.0, 120.0
RING = Ring((120.0, 80.0), 50.0, 50.0, SHEET_MM)
AHEAD_MM = np.linspace(5, 60, SHAPE[1]) + np.zeros(SHAPE)


def _found(monkeypatch, blue, wall=lambda mm: np.zeros_like(mm), black=0.0, ahead=1.0, line=0.0, noise=2.0):
    """Return what is told where blue is exp(``blue``) of the way, mm, on wall whose blue is exp(``wall``).

    ``black`` is the black level; light falls to ``ahead`` at the end of the view; ``line`` is what the laser
    adds to red of its line; ``noise`` is 1 σ in grey levels.
    """
    random, at_line = np.random.default_rng(1), np.abs(AHEAD_MM - 50) < 2
    lights = (Illumination.LED, Illumination.BOTH) if line else (Illumination.LED,)
    # Without a frame of the laser alone, the photo's black level is that of the frames.
    camera, of_photo = SimpleNamespace(black=SimpleNamespace(value=black)), np.nan if line else black
    fall = ahead ** ((AHEAD_MM - SHEET_MM) / (60 - SHEET_MM))
    state = SimpleNamespace(outside=None, noise=camera, photo_black=of_photo, shows_wall=lights)

    class Drawn:
        def __init__(self, scene, state):
            self.state = state

        def frame(self, number, light):
            place = (number * STEP_MM + AHEAD_MM).astype(np.float32)
            even = (80 * fall).astype(np.float32)
            region = np.full(SHAPE, Region.WALL, np.uint8)
            region[at_line if light == Illumination.BOTH else at_line & False] = Region.UNSEEN
            return TwinFrame(even, even, region, place, 0 * place)

    def photo(mm, azimuth):
        # The photo of a place was made when the sheet passed it.
        return black + 80 * np.stack([np.exp(blue(mm - SHEET_MM) + wall(mm)), *np.ones((2, *mm.shape))])

    def picture(number):
        way = number * STEP_MM
        level = 80 * np.stack([np.exp(blue(way) + wall(way + AHEAD_MM)), *np.ones((2, *SHAPE))], -1)
        level = black + level * fall[..., None]
        level[at_line, 2] += line
        return np.clip(np.round(level + noise * random.standard_normal(level.shape)), 0, 255).astype(np.uint8)

    monkeypatch.setattr(colours, "Renderer", Drawn)
    monkeypatch.setattr(colours, "replace", lambda scene, **changes: scene)
    scene = SimpleNamespace(reflectance=SimpleNamespace(coloured=photo), ring=RING)
    return colour_over_run(scene, state, [(k, picture(k)) for k in range(FRAMES)])


@pytest.mark.parametrize("whole", [-0.7, 0.5])
def test_a_colour_that_drifts_is_told_with_its_direction(monkeypatch, whole):
    (found,) = _found(monkeypatch, lambda mm: whole * mm / LENGTH_MM)
    assert (found.name, found.channel) == ("", "colour")
    # Wall ahead is shown before its photo was made: it has more of a colour that is lost.
    assert found.parameters[0].value == pytest.approx(np.expm1(-whole * 0.9 * 55 / LENGTH_MM), abs=0.03)
    assert "blue" in found.statement


def test_wall_of_another_colour_is_no_change_of_colour(monkeypatch):
    assert _found(monkeypatch, lambda mm: 0 * mm) == ()
    assert _found(monkeypatch, lambda mm: 0 * mm, lambda mm: 0.5 * np.sin(mm / 10)) == ()
    assert _found(monkeypatch, lambda mm: 0 * mm, lambda mm: 0.008 * mm) == ()


def test_a_black_level_on_coloured_wall_that_is_darker_ahead_is_no_change_of_colour(monkeypatch):
    """Brown wall in a camera whose black level is 12 grey levels had 24 % more blue ahead."""
    brown, still = (lambda mm: 0 * mm - 1.0), (lambda mm: 0 * mm)
    assert _found(monkeypatch, still, brown, black=12.0, ahead=0.4) == ()
    assert len(_found(monkeypatch, lambda mm: 0.7 * mm / LENGTH_MM, brown, black=12.0, ahead=0.4)) == 1


def test_noise_of_dark_colours_is_no_change_of_colour(monkeypatch):
    """The brighter half of the dark pixels was taken for wall with more blue."""
    brown, still = (lambda mm: 0 * mm - 1.6), (lambda mm: 0 * mm)
    assert _found(monkeypatch, still, brown, ahead=0.3, noise=6.0) == ()


def test_the_laser_under_both_lights_is_no_change_of_colour(monkeypatch):
    """The line's own pixels were compared with wall."""
    brown, still = (lambda mm: 0 * mm - 1.0), (lambda mm: 0 * mm)
    assert _found(monkeypatch, still, brown, black=12.0, ahead=0.4, line=120.0) == ()


def test_a_side_told_by_small_changes_of_grey_is_withdrawn_beside_a_change_of_colour():
    """A growing colour cast was "too dark near the lamps about image azimuth 60°"."""
    at = (NamedFigure("azimuth_deg", 60.0, 7.5),)
    side, led = (
        Mismatch(n, "intensity", "image", at, (), 0, 2, 1, "Dark.")
        for n in ("led_dead or window_dirt", "led_dead")
    )
    colour = Mismatch("", "colour", "time", (), (), 0, 2, 1, "")
    left, withdrawn = beside_colour((side, led), (colour,))
    assert left == (led,)
    assert "colour of wall differs" in withdrawn[0].statement
    assert beside_colour((side, led), ()) == ((side, led), ())


def test_few_frames_are_spread_over_the_recording():
    assert few_lit(list(range(0, 60, 2))).tolist() == [0, 8, 16, 24, 32, 40, 48, 56]
    assert few_lit([]).tolist() == []
