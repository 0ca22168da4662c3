"""A second line and a mirror image of the line, on synthetic pictures; and what is none."""

import numpy as np
import pytest

from stages.twin.glow import LIGHT
from tests.unit.whole_pictures import (
    AWAY,
    PHI,
    SHAPE,
    U,
    V,
    found_in,
    named,
)


def test_a_second_ring_is_found_and_a_glint_is_not_taken_for_one():
    second = 150 * 0.1 * np.exp(-0.5 * ((AWAY - 92) / 1.5) ** 2)
    assert named(laser=lambda p, r: p + second) == ["second_line"]
    glint = 60 * np.exp(-0.5 * (((U - 240) / 6) ** 2 + ((V - 120) / 6) ** 2))
    assert "second_line" not in named(laser=lambda p, r: p + glint)


def test_a_mirror_image_of_the_line_is_found_and_a_glow_about_the_line_is_not_taken_for_one():
    """It lies at another ratio of radii in each direction if the probe is askew; it had no name."""
    away = AWAY - 70 * (0.7 + 0.04 * np.cos(PHI) + 0.02 * np.sin(2 * PHI))
    assert named(laser=lambda p, r: p + 8 * np.exp(-0.5 * (away / 1.5) ** 2)) == ["second_line"]
    for reach in (8, 25):
        glow = 40 * np.exp(-abs(AWAY - 70) / reach)
        # At most as light on the wall.
        assert named(laser=lambda p, r, more=glow: p + more) == [LIGHT] * (reach == 25)


@pytest.mark.parametrize("peak", [20, 40])
def test_noise_beside_a_faint_line_is_no_second_line(peak):
    """The brightest of 200 bins of noise were told as light beside the line, at a chance of 1e-13."""
    assert named(laser=lambda p, r: p * peak / 150) == []


@pytest.mark.parametrize(("higher", "told"), [(0.8, 0), (2, 1)])
def test_rounding_beside_a_faint_line_is_no_second_line(higher, told):
    """A margin that a codec leaves without noise was half a level above the view: 2 % of a faint line."""
    step = higher * (abs(AWAY - 92) < 4)
    assert len(named(laser=lambda p, r: np.where(AWAY > 80, step, p * 40 / 150))) == told


@pytest.mark.parametrize("aside_px", [0, 4])
def test_the_sentence_of_a_second_ring_gives_the_share_that_its_figure_gives(aside_px):
    """The figure was 7.9 %, from frames rendered again, and the sentence said 5 %, from means around it."""
    away = AWAY - 92 - aside_px * np.cos(PHI)
    (found,), _ = found_in(laser=lambda p, r: p + 15 * np.exp(-0.5 * (away / 1.5) ** 2))
    (share,) = found.parameters
    assert found.name == "second_line"
    assert np.isfinite(share.sd)
    assert f"{100 * share.value:.0f} % as bright" in found.statement


def test_the_share_of_a_second_ring_without_a_name_has_no_sigma():
    """Its height in means over quarters of the picture was 2.2 ± .15 % where .0925 was drawn."""
    away = AWAY - 70 * (0.7 + 0.08 * np.sin(4 * PHI) + 0.04 * np.cos(PHI))
    (found,), _ = found_in(laser=lambda p, r: p + 14 * np.exp(-0.5 * (away / 1.5) ** 2))
    assert (found.name, found.parameters[0].sd) == ("ghost_ring or second_line", np.inf)
    assert "may be brighter" in found.statement


def test_the_share_of_a_second_ring_of_another_shape_than_the_line_has_no_sigma():
    """It was 3.5 ± .1 % where 10 % were drawn: less than in means over quarters of the picture."""
    away = AWAY - 92 - 3 * np.cos(2 * PHI)
    (found,), _ = found_in(laser=lambda p, r: p + 15 * np.exp(-0.5 * (away / 1.5) ** 2))
    assert (found.name, found.parameters[0].sd) == ("second_line", np.inf)
    assert "may be brighter" in found.statement


def test_constant_offsets_of_pixels_are_no_second_line():
    """Noise was only that from frame to frame: offsets of 4 grey levels were a second line."""
    offset = 9 * np.random.default_rng(1).standard_normal(SHAPE)
    assert named(laser=lambda p, r: p + offset) == []


def test_hot_pixels_are_no_second_line():
    """Sixty-six of them were a ghost ring of 2 % beside their own name: the inner bins hold few pixels."""
    random = np.random.default_rng(11)
    hot = np.zeros(SHAPE)
    hot[random.integers(0, SHAPE[0], 70), random.integers(0, SHAPE[1], 70)] = 90.0
    names = named(laser=lambda p, r: p + hot, lit=lambda p, r: p + hot)
    assert not any("second_line" in name for name in names)
