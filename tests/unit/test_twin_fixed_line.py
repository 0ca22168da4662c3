"""Displacements of the line at one place of the image, found from rings where lit frames show nothing."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.artefacts.wall_map import FixedPlace, FixedToProbe
from pipeline.recording.base import Illumination
from stages.twin.fixed_line import beside_absent_light, on_line
from stages.twin.glints import Spot, SpotsOfFrames
from stages.twin.scene import Ring
from stages.twin.seen_in_photo import beside_sectors

_RING = Ring((400.0, 300.0), 200.0, 50.0, 22.0)


def _fixed(*more, on_probe=True):
    place = FixedPlace(np.pi / 2, 0.2, -0.8, 0.02, 60.0, 4, 90, on_probe)
    return FixedToProbe(np.zeros((3, 3), np.float32), (place, *more))


def _rings(lost_deg=()):
    """Return rings of one sample a degree, most of which lost the line between two azimuths."""
    psi = np.radians(np.arange(-180.0, 180.0))
    validity = np.full((10, 360), RingValidity.VALID, np.uint8)
    if lost_deg:
        inside = (psi > np.radians(lost_deg[0])) & (psi < np.radians(lost_deg[1]))
        validity[:8, inside] = RingValidity.WIDTH
    made = [np.ones((10, 360), np.float32) for _ in range(4)]
    return RingSamples(np.arange(10), psi, np.array([400.0, 300.0]), *made, validity)


def _at(u, v, radius):
    place = (NamedFigure(n, x, 4.0, "px") for n, x in (("u_px", u), ("v_px", v), ("radius_px", radius)))
    return Mismatch("droplet", "intensity", "image", tuple(place), (), 0.0, 2.0, 1.0, "")


def test_a_place_of_the_image_that_moves_the_line_is_reported_without_a_name():
    (found,) = on_line(_fixed(), _rings(), _RING, ())
    assert (found.name, found.channel, found.fixed_to) == ("", "line", "image")
    assert [p.value for p in found.place] == pytest.approx([400, 500, 20], abs=2)
    # An eighth of the departure was stated as its σ, which nobody had measured.
    assert (found.parameters[0].value, found.parameters[0].sd) == (-0.8, 0.02)
    assert "-0.80 mm" in found.statement


def test_a_groove_along_the_pipe_and_places_already_reported_are_not_reported():
    assert not on_line(None, _rings(), _RING, ())
    assert not on_line(_fixed(on_probe=False), _rings(), _RING, ())
    assert not on_line(_fixed(), _rings(), _RING, [_at(410.0, 490.0, 15.0)])
    assert on_line(_fixed(), _rings(), _RING, [_at(200.0, 300.0, 15.0)])


def test_a_drop_in_which_the_line_is_not_seen_is_one_place_from_rim_to_rim():
    """A drop of 43 px was not found: the line left the rings at both rims and was not found in between."""
    other = FixedPlace(np.radians(116.0), 0.04, 0.7, 0.02, 60.0, 0, 90, on_probe=True)
    (found,) = on_line(_fixed(other), _rings(lost_deg=(90.0, 116.0)), _RING, ())
    u, v, radius = (p.value for p in found.place)
    middle = np.radians(100.7)
    assert np.hypot(u - 400 - 200 * np.cos(middle), v - 300 - 200 * np.sin(middle)) < 5
    assert radius == pytest.approx(200 * np.radians(16.4), abs=5)
    assert len(on_line(_fixed(other), _rings(), _RING, ())) == 2
    assert len(on_line(_fixed(other), _rings(lost_deg=(-60.0, -40.0)), _RING, ())) == 2


def test_other_wall_seen_through_a_drop_is_not_a_glint():
    spots = SpotsOfFrames(Illumination.LED, _RING)
    for frame in range(8):
        spots.frame.append(frame)
        spots.excess.append(np.zeros((75, 100), np.float32))
        at = (395.0 + 30 * (frame % 2), 505.0 - 25 * (frame % 3))
        spots.spots.append(Spot(frame, at, (90.0 * frame, 40.0 * frame), 6.0, 70.0))
    assert spots.found()
    assert not spots.found(bent=[_at(400.0, 500.0, 60.0)])
    assert spots.found(bent=[_at(100.0, 500.0, 60.0)])


def test_a_displaced_line_remains_beside_a_sector_that_the_same_drop_dims():
    """It was withdrawn as if its photo had caused it, and with it the evidence of something on the window."""
    bent = on_line(_fixed(), _rings(), _RING, ())
    place = (NamedFigure("azimuth_deg", 91.0, 1.0), NamedFigure("width_deg", 8.0, 2.0))
    sector = Mismatch("laser_sector or window_scatter", "line", "line", place, (), 0.0, 2.0, 1.0, "")
    assert len(bent) == 1
    assert beside_sectors(bent, (sector,), _RING) == (bent, ())


@pytest.mark.parametrize(("lost", "sd", "stays"), [(0.94, 0.03, False), (0.94, 0.01, True), (0.6, 0.1, True)])
def test_a_line_of_which_no_light_may_be_left_has_no_place(lost, sd, stays):
    """In a sector that had lost 94 ± 3 % of its light the line was told as displaced by .165 ± .015 mm."""
    bent = on_line(_fixed(), _rings(), _RING, ())
    place = (NamedFigure("azimuth_deg", 91.0, 1.0), NamedFigure("width_deg", 20.0, 2.0))
    size = (NamedFigure("lost", lost, sd),)
    other = (0.0, 2.0, 1.0, "")
    sector = Mismatch("laser_sector or window_scatter", "line", "line", place, size, *other)
    kept, withdrawn = beside_absent_light(bent, (sector,), _RING)
    assert (kept == bent, len(withdrawn)) == (stays, not stays)
    elsewhere = replace(sector, place=(replace(place[0], value=-20.0), place[1]))
    assert beside_absent_light(bent, (elsewhere,), _RING) == (bent, ())
