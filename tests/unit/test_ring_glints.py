"""What only one ring shows: glints are removed, pits on two rings are kept, a single line is unsure."""

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.rings.chain import choose_line
from stages.rings.glints import lone_runs
from stages.rings.search import Candidates
from stages.rings.validity import contradicted, off_laser_alone

RINGS, SECTORS, NOISE = 12, 720, 0.1
AZIMUTH = 2 * np.pi / SECTORS * np.arange(SECTORS)
RUN = slice(200, 216)


@pytest.fixture
def drawn():
    """Return rings of a probe that moves across the pipe: radius, σ, width and amplitude."""
    random = np.random.default_rng(3)
    shift = 2.0 * np.sin(0.7 * np.arange(RINGS))[:, None]
    radius = 300 + shift * np.cos(AZIMUTH - 0.3) + random.normal(0, NOISE, (RINGS, SECTORS))
    width = 1.2 * np.exp(random.normal(0, 0.05, radius.shape))
    amplitude = 80 * np.exp(random.normal(0, 0.2, radius.shape))
    return [x.astype(np.float32) for x in (radius, np.full_like(radius, NOISE), width, amplitude)]


def test_noise_and_motion_remove_no_sample(drawn):
    rejected, sigma = lone_runs(*drawn)
    assert rejected.sum() == 0
    assert np.mean(sigma > 1.01 * NOISE) < 1e-3


@pytest.mark.parametrize("away", [1.0, 6.0, -6.0])
def test_a_glint_is_removed(drawn, away):
    radius, _, width, amplitude = drawn
    radius[5, RUN] += away
    width[5, RUN] *= 1.4
    amplitude[5, RUN] *= 2
    rejected, _ = lone_runs(*drawn)
    assert rejected[5, RUN].mean() > 0.9
    rejected[5, RUN] = False
    assert rejected.sum() == 0, "rings beside a glint are not blamed for it"


@pytest.mark.parametrize(("rings", "width_factor", "gain"), [(2, 1.1, 1.7), (3, 1.4, 2.0), (6, 1.4, 2.0)])
def test_a_pit_on_two_rings_is_kept_and_on_three_even_if_it_is_bright(drawn, rings, width_factor, gain):
    radius, _, width, amplitude = drawn
    for row in range(4, 4 + rings):
        radius[row, RUN] += 3 * np.hanning(16)
        width[row, RUN] *= width_factor
        amplitude[row, RUN] *= gain
    rejected, sigma = lone_runs(*drawn)
    assert rejected.sum() == 0
    assert sigma[4 : 4 + rings, RUN].max() < 2 * NOISE


@pytest.mark.parametrize("sectors_a_ring", [0, 20, -20])
def test_a_pit_that_a_rolling_probe_sees_at_another_azimuth_in_every_ring_is_sure(sectors_a_ring, drawn):
    """Of a pit 1.1 mm deep each ring was alone, its σ became a third of its depth, and it was not found."""
    rings = rings_of(drawn)
    pit = np.zeros_like(rings.radius_px)
    for row in range(4, 9):
        pit[row, RUN] = 3 * np.hanning(16)
        pit[row] = np.roll(pit[row], sectors_a_ring * row)
    rings.radius_px[:] += pit
    validity, sigma = contradicted(rings)
    sure = (validity == RingValidity.VALID) & (sigma < 2 * NOISE)
    assert sure[pit > 1].mean() > 0.8  # by chance, some samples stand out from their neighbours


def test_glints_that_move_at_random_are_no_roll(drawn):
    rings, random = rings_of(drawn), np.random.default_rng(5)
    glints = np.zeros_like(rings.radius_px)
    for row in range(2, 10):
        glints[row, RUN] = 3.0
        glints[row] = np.roll(glints[row], random.integers(-40, 40))
    rings.radius_px[:] += glints
    rings.width_px[glints > 0] *= 1.4
    rings.amplitude[glints > 0] *= 2
    validity, _ = contradicted(rings)
    assert (validity[glints > 0] == RingValidity.GLINT).mean() > 0.8


@pytest.mark.parametrize(("rolls", "spiral"), [(30, False), (160, False), (0, True)])
def test_a_pit_is_sure_where_something_else_turns(rolls, spiral):
    """Half of a shallow pit was unsure where the probe had rolled before, or a spiral seam went by."""
    random, rings, by_ring = np.random.default_rng(4), 160, 20
    radius = 300 + random.normal(0, NOISE, (rings, SECTORS))
    turn = by_ring * np.minimum(np.arange(rings), rolls)
    shapes = [(10, 6, 6.0, turn), (120, 6, 0.8, turn)]
    shapes += [(0, rings, -2.0, by_ring * np.arange(rings))] if spiral else []
    for first, count, height, at in shapes:
        for row in range(first, first + count):
            shape = height * np.pad(np.hanning(12), (0, SECTORS - 12))
            radius[row] += np.roll(shape, (100 if height < 0 else 400) + at[row])
    drawn = [radius, *(np.full_like(radius, value) for value in (NOISE, 1.2, 80.0))]
    validity, sigma = contradicted(rings_of([x.astype(np.float32) for x in drawn], rings))
    pit = radius[120:126] > 300.4
    sure = (validity[120:126] == RingValidity.VALID) & (sigma[120:126] < 2 * NOISE)
    assert sure[pit].mean() > 0.8


def rings_of(drawn, rings=RINGS):
    """Return the drawn rings as samples, all valid."""
    validity = np.full(drawn[0].shape, RingValidity.VALID, np.uint8)
    return RingSamples(np.arange(rings), AZIMUTH - np.pi, np.zeros(2), *drawn, validity)


def test_a_line_on_one_ring_only_is_kept_and_unsure(drawn):
    drawn[0][5, RUN] += 3.0
    rejected, sigma = lone_runs(*drawn)
    assert rejected.sum() == 0
    assert np.allclose(sigma[5, RUN], 3 * np.sqrt(0.1), rtol=0.15)


def test_where_there_are_glints_a_single_line_is_as_likely_a_glint(drawn):
    radius, _, width, amplitude = drawn
    radius[5, RUN] += 3.0
    for row, first in ((4, 300), (5, 400), (5, 500), (6, 600)):
        glint = slice(first, first + 16)
        radius[row, glint] -= 5.0
        width[row, glint] *= 1.4
        amplitude[row, glint] *= 2
    _, sigma = lone_runs(*drawn)
    assert np.all(sigma[5, RUN] > 1.5 * 3 * np.sqrt(0.1))


def test_a_step_of_the_bore_is_not_a_glint(drawn):
    radius, _, width, _ = drawn
    radius[6:] += 20.0
    width[6:] *= 1.3
    radius[5, : SECTORS // 2] += 20.0
    assert lone_runs(*drawn)[0].mean() < 0.01


def test_gaps_and_lost_rings_are_bridged(drawn):
    radius, sigma, width, amplitude = drawn
    validity = np.zeros(radius.shape, np.uint8)
    validity[4], validity[:, 100:140] = RingValidity.FRAME_REJECTED, RingValidity.NO_LINE
    for field in (radius, sigma, width, amplitude):
        field[validity > 0] = np.nan
    radius[6, RUN] += 6
    amplitude[6, RUN] *= 3
    rings = RingSamples(
        np.arange(RINGS), AZIMUTH - np.pi, np.zeros(2), radius, sigma, width, amplitude, validity
    )
    told, _ = contradicted(rings)
    assert (told[6, RUN] == RingValidity.GLINT).mean() > 0.9
    assert ((told != validity).sum(1)[[0, 1, 2, 3, 5, 8, 9, 10, 11]] < 8).all()


def candidates_of(line, line_score, other, other_score):
    """Return two candidates a sector, the stronger first."""
    radius, score = (np.stack(x, 1) for x in ((line, other), (line_score, other_score)))
    order = np.argsort(-score, axis=1)
    return Candidates(*(np.take_along_axis(x, order, 1) for x in (radius, score)))


def test_the_brighter_of_two_candidates_is_not_the_line_where_the_other_continues_the_curve():
    random = np.random.default_rng(1)
    line, glint = 300 + random.normal(0, 0.1, SECTORS), np.full(SECTORS, np.nan)
    glint[RUN] = 307.0
    score = np.where(np.isfinite(glint), 120.0, 0.0)
    found = choose_line(
        candidates_of(line, np.full(SECTORS, 40.0), glint, score), np.full(SECTORS, 300.0), 1.2
    )
    assert np.allclose(found.radius_px, line)
    assert found.probability.min() > 0.99


def test_a_jump_of_the_wall_is_followed_and_a_weak_remainder_is_not():
    line, remnant = np.full(SECTORS, 300.0), np.full(SECTORS, np.nan)
    line[RUN], remnant[RUN] = 312.0, 300.0
    weak = candidates_of(line, np.full(SECTORS, 40.0), remnant, np.where(np.isfinite(remnant), 6.0, 0.0))
    assert np.allclose(choose_line(weak, np.full(SECTORS, 300.0), 1.2).radius_px, line)


def test_between_two_equal_lines_the_choice_is_unsure():
    """Both branches close a split curve: the σ must include the distance between them."""
    line, other = np.full(SECTORS, 296.0), np.full(SECTORS, 304.0)
    both = candidates_of(line, np.full(SECTORS, 40.0), other, np.full(SECTORS, 39.0))
    found = choose_line(both, np.full(SECTORS, 296.0), 1.2)
    unsure = found.probability < 0.9
    assert unsure.all() or np.allclose(found.radius_px, 296.0)


def test_a_run_past_a_place_without_wall_to_compare_has_no_unknown_sigma(drawn):
    radius = drawn[0]
    radius[5, RUN] += 3.0
    radius[:5, 208:210] = radius[6:, 208:210] = np.nan
    assert np.isfinite(lone_runs(*drawn)[1]).all()


@pytest.mark.parametrize(("lit_px", "kept"), [(60.0, False), (330.0, False), (301.0, True)])
def test_a_lit_picture_that_shows_another_edge_is_refuted_by_the_laser_alone(drawn, lit_px, kept):
    """The wall was lit and clipped in every other picture, and the dark end of the pipe became its ring."""
    rings, alone = rings_of(drawn), np.arange(RINGS) % 2 == 0
    rings.radius_px[~alone] += np.float32(lit_px - 300)
    rings.validity[~alone, ::3] = RingValidity.NO_LINE
    assert off_laser_alone(rings, alone)[~alone, 1].any() != kept
    assert off_laser_alone(rings, alone).sum() == (0 if kept else rings.valid[~alone].sum())
    assert not off_laser_alone(rings, np.zeros(RINGS, bool)).any(), "no picture tells which ring is right"
