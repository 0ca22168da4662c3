"""A picture of two parts that do not fit together is recognised by its rings.

A one-sided step of the pipe is not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.rings.seam import seam_of, warn_of_seam
from tests.quiet import quiet_context

FRAMES, AZIMUTHS, CENTRE = 30, 1440, (398.0, 296.0)
AZIMUTH = -np.pi + np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS


def rings(aside: tuple[float, float] = (0.0, 0.0), axis: int = 0, at_px: float = 400.0) -> RingSamples:
    """Return rings of a swaying probe in an oval pipe, moved beyond a column (axis 0) or row by ``aside``.

    The line is followed finely, moved, and read at its azimuths again; on the seam there is none.
    """
    random = np.random.default_rng(5)
    fine = np.linspace(-np.pi, np.pi, 7200, endpoint=False)
    radius = np.empty((FRAMES, AZIMUTHS))
    for k in range(FRAMES):
        sway = 12 * np.array([np.sin(0.3 * k), np.cos(0.2 * k)])
        r = 206 + 2.5 * np.cos(2 * fine + 0.1 * k) + 1.0 * np.cos(5 * fine + 0.7)
        line = np.stack([np.cos(fine), np.sin(fine)], -1) * r[:, None] + sway
        line[line[:, axis] > at_px - CENTRE[axis]] += aside
        angle = np.arctan2(line[:, 1], line[:, 0])
        order = np.argsort(angle)
        radius[k] = np.interp(AZIMUTH, angle[order], np.hypot(*line.T)[order], period=2 * np.pi)
    radius += random.normal(0, 0.08, radius.shape)
    direction = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)], -1)
    on_seam = np.abs((radius[..., None] * direction + CENTRE)[..., axis] - at_px) < 4
    lost = on_seam & (np.abs(direction[:, 1 - axis]) > 0.5) & any(aside)
    validity = np.where(lost, RingValidity.WIDTH, RingValidity.VALID).astype(np.uint8)
    alike = np.full(radius.shape, 0.08, np.float32)
    return RingSamples(
        np.arange(FRAMES), AZIMUTH, np.array(CENTRE), radius.astype(np.float32), alike, 10 * alike,
        1000 * alike, validity,
    )  # fmt: skip


@pytest.mark.parametrize(("axis", "aside"), [(0, (0.0, 2.0)), (0, (0.5, -1.0)), (1, (1.0, 0.0))])
def test_displaced_parts_of_the_picture_are_reported_with_place_and_size(
    axis: int, aside: tuple[float, float]
) -> None:
    """Half of the picture 2 px lower hid a pit; 44 % of the radii were inside their σ, without a message."""
    at_px = (400.0, 310.0)[axis]
    seam = seam_of(rings(aside, axis, at_px))
    assert seam is not None
    assert seam.along == ("column", "row")[axis]
    assert seam.at_px == pytest.approx(at_px, abs=4)
    assert seam.step_px == pytest.approx(abs(aside[1 - axis]), abs=0.25)
    said: list[str] = []
    warn_of_seam(seam, replace(quiet_context(), warn=said.append))
    assert "the picture has a seam" in said[0]


def test_a_seam_is_reported_beside_other_steps() -> None:
    """Burnt-in text or a ledge of the wall causes steps too."""
    seamed = rings((0.0, 2.0))
    ledge = seamed.radius_px + 3.0 * (np.abs(AZIMUTH - 0.4) < 0.25).astype(np.float32)
    seam = seam_of(replace(seamed, radius_px=ledge))
    assert seam is not None
    assert (seam.along, seam.at_px) == ("column", pytest.approx(400, abs=4))
    assert seam.step_px == pytest.approx(2.0, abs=0.25)


def test_whole_pictures_and_walls_with_a_one_sided_step_have_no_seam() -> None:
    """A row tangent to the ring touched both ends of the part that interlacing disturbs."""
    sound = rings()
    assert seam_of(sound) is None
    ledge = sound.radius_px + 2.0 * (np.abs(AZIMUTH - 1.0) < 0.4).astype(np.float32)
    assert seam_of(replace(sound, radius_px=ledge)) is None
    grazed = sound.radius_px + 2.0 * (np.abs(AZIMUTH - np.pi / 2) < 0.12).astype(np.float32)
    assert seam_of(replace(sound, radius_px=grazed)) is None
    weld = sound.radius_px - 2.0 * (np.abs(AZIMUTH - np.pi / 2) < 0.03).astype(np.float32)
    assert seam_of(replace(sound, radius_px=weld)) is None


def test_a_step_in_some_rings_is_not_one_of_the_picture() -> None:
    sound, spoilt = rings(), rings((0.0, 2.0))
    some = np.arange(FRAMES)[:, None] < FRAMES // 3
    radius = np.where(some, spoilt.radius_px, sound.radius_px)
    assert seam_of(replace(sound, radius_px=radius)) is None
