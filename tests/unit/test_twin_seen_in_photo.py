"""Dirt that the photo holds, too, is not told a second time where frames show the wall beside it."""

import pytest

from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.scene import Ring
from stages.twin.seen_in_photo import parted_from_photo

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
        (_place("", 530.0, 513.0, -0.5), False),  # by more than the dirt takes
        (_place("", 530.0, 513.0, 0.098), False),  # darker
        (_place("", 270.0, 513.0, -0.098), False),  # at another azimuth
        (_place("window_dirt", 530.0, 513.0, 0.098), False),
    ],
)
def test_what_the_photo_holds_of_dirt_is_withdrawn_at_its_azimuth(bright, left):
    dust = _place("window_dirt", 497.0, 468.0, 0.294)
    kept, withdrawn = parted_from_photo((dust, bright), _RING)
    assert kept == ((dust,) if left else (dust, bright))
    assert len(withdrawn) == left
    assert all("darker there" in m.statement for m in withdrawn)
    assert parted_from_photo((bright,), _RING) == ((bright,), ())
