"""Dirt that the photo contains as well is not reported a second time where frames show the wall beside it."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.scene import Ring
from stages.twin.seen_in_photo import beside_sectors, separated_from_photo

_RING = Ring((400.0, 298.0), 207.0, 50.0, 22.0)


def _place(name, u, v, share):
    place = tuple(NamedFigure(n, x, 8.0, "px") for n, x in (("u_px", u), ("v_px", v), ("radius_px", 16.0)))
    return Mismatch(
        name, "intensity", "image", place, (NamedFigure("share", share, 0.01),), 0, 2, 1, "It is."
    )


@pytest.mark.parametrize(
    ("bright", "left"),
    [
        (_place("", 530.0, 513.0, -0.098), True),  # at 58.8°, as dust of 29 % at 60.3° left it in its photo
        (_place("", 530.0, 513.0, -0.5), False),  # by more than the dirt removes
        (_place("", 530.0, 513.0, 0.098), False),  # darker
        (_place("", 270.0, 513.0, -0.098), False),  # at another azimuth
        (_place("window_dirt", 530.0, 513.0, 0.098), False),
    ],
)
def test_dirt_contained_in_the_photo_is_withdrawn_at_its_azimuth(bright, left):
    dust = _place("window_dirt", 497.0, 468.0, 0.294)
    kept, withdrawn = separated_from_photo((dust, bright), _RING)
    assert kept == ((dust,) if left else (dust, bright))
    assert len(withdrawn) == left
    assert all("darker there" in m.statement for m in withdrawn)
    assert separated_from_photo((bright,), _RING) == ((bright,), ())


@pytest.mark.parametrize(("brighter", "left"), [(0.3, True), (0.03, False), (0.9, False)])
def test_a_dark_stain_of_the_photo_is_no_scatter(brighter, left):
    """Beside dirt that took .6 of the light, its stain in the photo was "scatter of 86 %"."""
    dust, stain = _place("window_dirt", 497.0, 468.0, 0.37), _place("window_scatter", 530.0, 513.0, 0.86)
    stain = replace(stain, parameters=(*stain.parameters, NamedFigure("brighter", brighter, 0.02)))
    assert len(separated_from_photo((dust, stain), _RING)[1]) == left


def test_two_places_that_are_both_brighter_do_not_explain_each_other():
    """Each was withdrawn because the other might have dimmed its photo, and nothing was left."""
    places = [_place("window_scatter", u, v, 0.4) for u, v in ((497.0, 468.0), (530.0, 513.0))]
    more = NamedFigure("brighter", 0.1, 0.01)
    both = tuple(replace(p, parameters=(*p.parameters, more)) for p in places)
    assert separated_from_photo(both, _RING) == (both, ())


@pytest.mark.parametrize(
    ("name", "at_deg", "left"), [("", -97.0, True), ("", -60.0, False), ("glint", -97.0, False)]
)
def test_a_wall_region_where_the_window_may_dim_the_line_cannot_be_decided(name, at_deg, left):
    """Scatter across the line at −100° left wall in its photo that seemed to shine at −97°."""
    place = (NamedFigure("azimuth_deg", -100.0, 3.0), NamedFigure("width_deg", 20.0, 5.0))
    turn, other = np.radians(at_deg), (0.0, 2.0, 1.0)
    sector = Mismatch("laser_sector or window_scatter", "line", "line", place, (), *other, "")
    look = Look(8, 400 + 250 * np.cos(turn), 298 + 250 * np.sin(turn), 60.0)
    region = Mismatch(name, "intensity", "wall", (), (), *other, "It shines.", look)
    kept, withdrawn = beside_sectors((region,), (sector,), _RING)
    assert (len(kept), len(withdrawn)) == (not left, left)
    assert all("what dims the line at that azimuth" in m.statement for m in withdrawn)
    assert beside_sectors((region,), (), _RING) == ((region,), ())
