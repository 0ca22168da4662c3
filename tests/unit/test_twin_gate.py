"""The decision by frames rendered again, on drawn improvements."""

import numpy as np
import pytest

from pipeline.artefacts.twin import Mismatch
from stages.twin.gate import Suspected, _borne_out, first_confirmed, judged
from stages.twin.significance import significance_over_frames


def test_an_effect_that_frames_show_unequally_is_confirmed_where_it_acts():
    random = np.random.default_rng(8)
    foretold = np.array([4.0, 9, 900, 30, 60, 14, 25])
    alike = foretold * (0.8 + 0.1 * random.standard_normal(7))
    assert significance_over_frames(alike)[0] < 3 < _borne_out(alike, foretold)[0]
    by_chance = foretold * (-1 + 0.8 * random.standard_normal(7))
    assert _borne_out(by_chance, foretold)[0] < 3
    assert _borne_out(np.zeros(0), np.zeros(0)) == (0.0, 1.0)


def test_two_tests_of_the_same_improvements_give_alarms_no_more_often_than_stated():
    random = np.random.default_rng(9)
    foretold = np.exp(0.8 * random.standard_normal((2000, 8)))
    chance = [_borne_out(f * random.standard_normal(8), f)[1] for f in foretold]
    # The two tests are correlated, so that together they alarm less often than twice; one alone does at .05.
    assert np.mean(np.array(chance) < 0.05) < 0.04


@pytest.mark.parametrize("otherwise", ["ghost_ring or second_line", ""])
def test_light_that_is_there_but_follows_no_law_loses_its_certain_name_only(otherwise):
    found = Mismatch("second_line", "line", "line", (), (), 1e-9, np.nan, np.nan, "Light beside the line.")
    suspected = Suspected(found, lambda shown, size: None, np.arange(8), np.ones((8, 1)), otherwise=otherwise)
    kept, withdrawn = judged([suspected], lambda frames: [])
    assert [m.name for m in kept] == [otherwise] * bool(otherwise)
    assert [m.name for m in withdrawn] == ["second_line"] * (not otherwise)


def test_a_blur_that_lit_frames_do_not_confirm_may_be_confirmed_by_the_line():
    """A line blurred by 2.5 px was not told: lit frames had suggested a blur that the photo has, too."""

    def one(name, law):
        found = Mismatch(name, "intensity", "image", (), (), 1e-9, np.nan, np.nan, "Blurred.")
        return Suspected(found, law, np.arange(8), np.ones((8, 1)))

    lit, line = one("defocus", lambda shown, size: None), one("thick_sheet", None)
    assert [[m.name for m in some] for some in first_confirmed((lit, line), lambda frames: [])] == [
        ["thick_sheet"],
        [],
    ]
    assert len(first_confirmed((line, line), lambda frames: [])[0]) == 1
    assert len(first_confirmed((lit,), lambda frames: [])[1]) == 1


def test_consecutive_frames_count_as_fewer_independent_ones():
    random = np.random.default_rng(5)
    apart = 1 + random.standard_normal(16)
    alike = 1 + np.repeat(random.standard_normal(4), 4)
    alike = 1 + (alike - alike.mean()) * apart.std() / alike.std()
    apart = 1 + apart - apart.mean()
    assert significance_over_frames(apart)[0] > 1.5 * significance_over_frames(alike)[0] > 0
    assert significance_over_frames(-apart)[1] > 0.5
