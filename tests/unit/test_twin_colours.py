"""Whether a colour that changes over the run is told from coloured wall and from noise."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import stages.twin.colours as colours
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.colours import beside_colour, colour_over_run, few_lit
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring

SHAPE, FRAMES, STEP_MM, SHEET_MM, LENGTH_MM = (160, 240), 8, 8.0, 23.0, 120.0
RING = Ring((120.0, 80.0), 50.0, 50.0, SHEET_MM)
AHEAD_MM = np.linspace(5, 60, SHAPE[1]) + np.zeros(SHAPE)


def _found(monkeypatch, blue, wall=lambda mm: np.zeros_like(mm)):
    """Return what is told where blue is exp(``blue``) of the way, mm, on wall whose blue is exp(``wall``)."""
    random = np.random.default_rng(1)

    class Drawn:
        def __init__(self, scene, state):
            pass

        def frame(self, number, light):
            place = (number * STEP_MM + AHEAD_MM).astype(np.float32)
            even = np.full(SHAPE, 80.0, np.float32)
            return TwinFrame(even, even, np.full(SHAPE, Region.WALL, np.uint8), place, 0 * place)

    def photo(mm, azimuth):
        # The photo of a place was made when the sheet passed it.
        return 80 * np.stack([np.exp(blue(mm - SHEET_MM) + wall(mm)), np.ones_like(mm), np.ones_like(mm)])

    def picture(number):
        way = number * STEP_MM
        level = 80 * np.stack([np.exp(blue(way) + wall(way + AHEAD_MM)), *np.ones((2, *SHAPE))], -1)
        return np.clip(np.round(level + 2 * random.standard_normal(level.shape)), 0, 255).astype(np.uint8)

    monkeypatch.setattr(colours, "Renderer", Drawn)
    monkeypatch.setattr(colours, "replace", lambda scene, **changes: scene)
    scene = SimpleNamespace(reflectance=SimpleNamespace(coloured=photo), ring=RING)
    return colour_over_run(scene, SimpleNamespace(outside=None), [(k, picture(k)) for k in range(FRAMES)])


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


def test_a_side_told_by_small_changes_of_grey_is_withdrawn_beside_a_change_of_colour():
    """A growing colour cast was "too dark near the lamps about image azimuth 60°"."""
    at = (NamedFigure("azimuth_deg", 60.0, 7.5),)
    side, led = (Mismatch(n, "intensity", "image", at, (), 0, 2, 1, "Dark.") for n in ("", "led_dead"))
    colour = Mismatch("", "colour", "time", (), (), 0, 2, 1, "")
    left, withdrawn = beside_colour((side, led), (colour,))
    assert left == (led,)
    assert "colour of wall differs" in withdrawn[0].statement
    assert beside_colour((side, led), ()) == ((side, led), ())


def test_few_frames_are_spread_over_the_recording():
    assert few_lit(list(range(0, 60, 2))).tolist() == [0, 8, 16, 24, 32, 40, 48, 56]
    assert few_lit([]).tolist() == []
