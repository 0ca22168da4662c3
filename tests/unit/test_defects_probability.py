"""How probable it is that a finding is real: its rings, its height above the noise's tail, its photo."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from stages.defects import DefectParameters
from stages.defects.corroborate import Evidence
from stages.defects.credibility import chance_of_depth, credibility_of
from stages.defects.detect import detect
from stages.defects.noise_tail import Law, NoiseTail, noise_tail
from stages.defects.noise_tail import tail_of as tail_of_peaks
from stages.defects.photo import photo_stands_out
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from tests.quiet import quiet_context
from tests.synthetic_wall import grey_texture, smooth_noise, wall_of
from tests.unit.dented_rows import AZIMUTH, DISTANCE, RADIUS, SIGMA, found


def tail_of(radius):
    """Return the tail of the distribution of a wall's noise, and its score."""
    wall = wall_of(DISTANCE, AZIMUTH, RADIUS + radius, SIGMA)
    relief = smooth_shape_removed(wall.radius_map, DefectParameters())
    context = quiet_context()
    seeds = detect(relief, 0.05, context.scratch, context.progress)
    return noise_tail(relief, seeds, np.zeros(radius.shape, bool)), seeds.score


@pytest.mark.parametrize("heavy", [False, True])
def test_the_tail_of_the_noise_predicts_the_number_of_high_peaks(heavy):
    """The prediction is within a factor of two of the count, whose own error is its square root."""
    random, told, counted = np.random.default_rng(4), 0.0, 0
    for _ in range(12):
        noise = smooth_noise(random, (len(DISTANCE), len(AZIMUTH)), SIGMA, 1.0)
        if heavy:
            noise *= np.exp(0.6 * smooth_noise(random, noise.shape, 1.0, 6.0))
        tail, score = tail_of(noise)
        told += tail.above(4.3)
        top = score == maximum_filter(score, 9, mode="wrap")
        counted += int((top & (score > 4.3)).sum())
    assert counted > 3
    chance = 2 * np.sqrt(counted)
    assert (counted - chance) / 2 < told < 2 * (counted + chance)


@pytest.mark.parametrize(("power", "scale"), [(2, 1.0), (2, 3.0), (1, 0.6)])
def test_the_tail_is_estimated_from_peaks_below_the_threshold(power, scale):
    """Peaks above it become findings: a tail counted from the remaining ones gave a quarter of such peaks."""
    excess = scale * np.random.default_rng(7).exponential(size=4000)
    peaks = (power * excess + NoiseTail.FROM**power) ** (1 / power)
    told, counted = tail_of_peaks(peaks[peaks < 4.8], 4.8).above(5.2), np.sum(peaks > 5.2)
    assert counted / 2 < told + 1 < 2 * (counted + 1)


def evidence(rings, score=30.0, bright=False):
    return Evidence(rings, False, score, bright=bright)


def probability(of, among, tail=None, widths=None):
    """Return the probability of a finding among others."""
    told = found(2).items[0]
    tail, widths = tail or NoiseTail(20.0, (Law(2, 1.2),)), widths or [0.03] * len(among)
    here = credibility_of(among, widths, 50, tail)
    return here.chance_against_clutter(of) * chance_of_depth(told, 0.2)


def test_two_rings_among_many_unconfirmed_ones_are_probably_false_and_many_rings_stay_sure():
    quiet, hard = [evidence(8)] * 4 + [evidence(2)], [evidence(8)] * 4 + [evidence(2)] + [evidence(1)] * 300
    assert probability(evidence(2), quiet) > 0.9 > 0.5 > probability(evidence(2), hard, widths=[0.3] * 305)
    assert probability(evidence(8), hard, widths=[0.3] * 305) > 0.9


def test_a_finding_no_higher_than_the_noise_of_its_recording_is_doubted():
    several = [evidence(5)] * 4
    heavy = NoiseTail(200.0, (Law(2, 6.0),))
    assert probability(evidence(5, 5.6), several) > 0.9 > 0.3 > probability(evidence(5, 5.6), several, heavy)
    assert probability(evidence(5, 30.0), several, heavy) > 0.95


def test_the_photo_raises_the_probability_of_a_finding_or_lowers_it_a_little():
    several, heavy = [evidence(5)] * 4, NoiseTail(200.0, (Law(2, 2.4),))

    def told(score, photo):
        return probability(replace(evidence(5, score), photo=photo), several, heavy)

    unknown, doubted, borne_out = (told(6.8, photo) for photo in (None, False, True))
    assert doubted < unknown - 0.1 < unknown + 0.2 < borne_out
    # A dent on plain wall leaves no trace in the photo: one that stands out of the noise stays sure.
    assert told(9.0, False) > 0.97


def test_a_photo_that_stands_out_at_many_glints_confirms_nothing():
    """At seven of 15 glints, photos with streaks stood out: a false pit of 1.59 ± .68 mm had .93."""
    alone = [evidence(1)] * 8
    streaked = [replace(e, photo=k % 2 == 0) for k, e in enumerate(alone)]
    pit = replace(evidence(1), photo=True)
    among = [evidence(5)] * 2 + [pit]
    assert probability(pit, [*among, *alone]) > 0.6 > 0.4 > probability(pit, [*among, *streaked])


def test_a_finding_and_the_few_that_may_be_real_do_not_count_against_their_photo():
    pit, two = replace(evidence(1), photo=True), [evidence(2)] * 3
    assert probability(pit, [*two, pit]) > 0.95
    assert probability(pit, [*two, pit, pit, pit]) > 0.95


def test_an_unknown_photo_changes_no_probability():
    wall = wall_of(DISTANCE, AZIMUTH, np.full((len(DISTANCE), len(AZIMUTH)), RADIUS), SIGMA)
    relief = smooth_shape_removed(wall.radius_map, DefectParameters()).rows(slice(0, len(DISTANCE)))
    place, unseen = Region(30, 100, np.ones((4, 12), bool), 1.0), grey_texture(wall)
    unseen.bgra[..., 3] = 0
    assert photo_stands_out(grey_texture(wall), relief, place) is False
    assert photo_stands_out(unseen, relief, place) is None
    assert photo_stands_out(grey_texture(wall), relief, replace(place, all_round=True)) is None
