"""Rings that differ from those of a good recording get a warning that says what is wrong.

Sound ones do not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.rings.expectation import warn_of_rings
from tests.quiet import quiet_context

RINGS, AZIMUTHS, SIZE = 40, 360, (640, 480)
SOUND_WANDER_PX, WIDTH_PX = 0.1, 1.2


def sound() -> RingSamples:
    plain = np.full((RINGS, AZIMUTHS), WIDTH_PX, np.float32)
    azimuth = np.linspace(-np.pi, np.pi, AZIMUTHS, endpoint=False)
    validity = np.zeros((RINGS, AZIMUTHS), np.uint8)
    return RingSamples(2 * np.arange(RINGS), azimuth, np.zeros(2), plain, plain, plain, plain, validity)


def told(rings: RingSamples, wander_px: float = SOUND_WANDER_PX, stepped: bool = False) -> str:
    warnings: list[str] = []
    warn_of_rings(rings, SIZE, wander_px, stepped, replace(quiet_context(), warn=warnings.append))
    return "\n".join(warnings)


def spoilt(rows: slice, columns: slice, reason: RingValidity) -> RingSamples:
    rings = sound()
    rings.validity[rows, columns] = reason
    return rings


def test_sound_rings_and_a_few_bad_samples_give_no_warning() -> None:
    assert told(sound()) == ""
    assert told(spoilt(slice(3, 5), slice(10, 20), RingValidity.GLINT)) == ""


def test_a_ring_that_leaves_the_picture_is_not_called_hidden() -> None:
    """The window was to be cleaned and text switched off, where the picture had been cropped."""
    radius_px = np.full((RINGS, AZIMUTHS), 250, np.float32)
    rings = replace(sound(), radius_px=radius_px, centre_px=np.array([320.0, 240.0]))
    for middle in (90, 270):
        rings.validity[:, middle - 16 : middle + 17] = RingValidity.NO_LINE
    assert told(rings).count("the ring leaves the picture there") == 2


@pytest.mark.parametrize(
    ("rows", "columns", "reason", "words"),
    [
        (slice(5, 8), slice(None), RingValidity.FRAME_REJECTED, "frame 10, 12, 14"),
        (slice(None), slice(-5, None), RingValidity.NO_LINE, "between 8:50 and 9:00"),
        (
            slice(0, 10),
            slice(0, 90),
            RingValidity.LOW_CONTRAST,
            "6.2 % of the ring samples show no measurable",
        ),
        (slice(0, 10), slice(0, 20), RingValidity.GLINT, "1.4 % of the ring samples show light"),
    ],
)
def test_the_fault_is_named(rows: slice, columns: slice, reason: RingValidity, words: str) -> None:
    text = told(spoilt(rows, columns, reason))
    assert words in text
    assert text.count("What to do") == 1


def test_in_coarse_pictures_the_pixels_are_blamed_and_not_the_window() -> None:
    rings = spoilt(slice(None), slice(-5, None), RingValidity.NO_LINE)
    coarse = replace(rings, width_px=np.full((RINGS, AZIMUTHS), 0.43, np.float32))
    text = told(coarse, wander_px=0.01)
    assert "the line is 0.43 px wide" in text
    assert text.count("What to do") == 1


def test_neighbouring_hidden_parts_are_reported_together() -> None:
    rings = spoilt(slice(None), slice(-5, None), RingValidity.NO_LINE)
    rings.validity[:, 10:15] = RingValidity.GHOST
    text = told(rings)
    assert text.count("What to do") == 1
    assert "between 8:50 and 9:30 in the picture, in 50 % of this sector, in most rings" in text
    rings.validity[:, 100:105] = RingValidity.GHOST
    assert told(rings).count("What to do") == 2


def test_a_wandering_line_is_reported() -> None:
    assert "the line wanders by 0.30 px" in told(sound(), 0.3)


def test_steps_of_a_gauge_break_the_line_by_design() -> None:
    rings = spoilt(slice(0, 10), slice(0, 90), RingValidity.LOW_CONTRAST)
    assert told(rings, stepped=True) == ""
    assert "the line wanders" in told(rings, 0.3, stepped=True)
