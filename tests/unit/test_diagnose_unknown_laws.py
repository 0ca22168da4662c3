"""How likely it is that laws which the library does not have make what was named."""

import numpy as np
import pytest

from stages.diagnose.effects.courses import with_courses
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.unknown_laws import known_alike, odds_in
from stages.diagnose.inference import UNKNOWN, Column, Stated
from tests.unit.test_diagnose_inference import CONE, evidence_of


@pytest.mark.parametrize(
    ("noise", "growing", "low", "high"),
    [(0.01, 0.0, 0.0, UNKNOWN / 20), (10.0, 0.0, UNKNOWN / 2, UNKNOWN), (0.1, 0.5, 1.0, np.inf)],
)
def test_a_name_is_less_sure_if_its_growth_with_the_radius_is_unsure_or_another(noise, growing, low, high):
    """A cone of size 1 that grows rightly, one too faint to show its growth, and one that grows otherwise."""
    random = np.random.default_rng(10)
    off = random.uniform(-0.5, 0.5, 200)
    one = Term(CONE, (), np.ones(1))
    columns = (Column("laser_cone", CONE.amplitudes[0].name), Column("other", "1"), Column("other", "2"))
    design = np.stack([off**n for n in range(3)], 1) / noise
    measured = design @ [1.0, growing, 0.0] + random.normal(size=200)
    about, nobody = evidence_of(design, measured, columns), Stated((), np.zeros((0, 0)))
    (odds,) = odds_in(about, [one], ["other"], ["same"], lambda terms: 0.0, nobody)
    assert low <= odds <= high


def test_each_known_law_of_a_kind_makes_an_unknown_one_of_that_kind_more_likely():
    """A drifting law belongs to the drifting ones; others count one sixth, as each has six courses."""
    names = ("focal_scale", "dome_axial", "focal_drift", "baseline", "baseline_drift", "pixel_locking")
    every = with_courses({n: LIBRARY[n] for n in names})
    alike = {n: known_alike(LIBRARY[n], every) for n in (*names[1:], "focal_scale")}
    drifting = {"focal_drift": 7 / 6, "baseline_drift": 7 / 6}
    static = {"focal_scale": 2, "dome_axial": 2, "baseline": 1, "pixel_locking": 0}
    assert alike == pytest.approx(drifting | static)
    assert known_alike(every["focal_scale, ramp"], every) == pytest.approx(7)


@pytest.mark.parametrize(
    ("power", "pattern", "noise", "low", "high"),
    [
        (1, "same", 1.0, 5 * UNKNOWN, np.inf),
        (6, "same", 0.01, 0.0, UNKNOWN / 2),
        (1, "another", 1.0, 0.0, UNKNOWN),
    ],
)
def test_two_names_that_one_unknown_law_can_replace_are_unsure(power, pattern, noise, low, high):
    """A cone and a baseline.

    The second grows with the radius, or as no smooth law does, or has another harmonic.
    """
    random = np.random.default_rng(11)
    off = random.uniform(-0.5, 0.5, 400)
    both = [Term(LIBRARY[name], (), np.ones(1)) for name in ("laser_cone", "baseline")]
    grown = [np.ones(400), 2.0 * off**power]
    design = np.stack([*grown, *(law * off**n for law in grown for n in (1, 2))], 1) / noise
    columns = (
        *(Column(t.model.name, t.amplitudes[0].name) for t in both),
        *(Column(f"like {t.model.name}", n) for t in both for n in "12"),
    )
    about = evidence_of(design, design[:, :2].sum(1) + random.normal(size=400), columns)
    others, rare = [f"like {t.model.name}" for t in both], 2 * np.log(30.0)
    odds = odds_in(
        about, both, others, ["same", pattern], lambda terms: rare * len(terms), Stated((), np.zeros((0, 0)))
    )
    assert all(low <= one <= high for one in odds)


@pytest.mark.parametrize(
    ("turned_deg", "low", "high"), [(0.0, 0.1, np.inf), (180.0, 0.1, np.inf), (60.0, 0.0, 0.01)]
)
def test_two_names_with_a_common_direction_may_be_one_unknown_law(turned_deg, low, high):
    """A tilted sheet and a decentred beam in the same, in the opposite and in another direction."""
    random, turn = np.random.default_rng(13), np.radians(turned_deg)
    sizes = (np.array([0.3, 0.0]), 0.3 * np.array([np.cos(turn), np.sin(turn)]))
    both = [Term(LIBRARY[n], (), a) for n, a in zip(("laser_tilt", "beam_decentre"), sizes, strict=True)]
    columns = tuple(Column(t.model.name, a.name) for t in both for a in t.amplitudes)
    columns += tuple(Column(f"like {t.model.name}", n) for t in both for n in "12")
    design = random.normal(size=(2000, len(columns)))
    measured = design[:, :4] @ np.concatenate(sizes) + random.normal(size=2000)
    about, others = evidence_of(design, measured, columns), [f"like {t.model.name}" for t in both]
    odds = odds_in(
        about,
        both,
        others,
        ["same"] * 2,
        lambda terms: 2 * np.log(30.0) * len(terms),
        Stated((), np.zeros((0, 0))),
    )
    assert all(low <= one <= high for one in odds)


def test_a_wave_and_a_pixel_aspect_are_not_one_unknown_law():
    """The direction of a pixel aspect is fixed, so that a common direction is no evidence."""
    random = np.random.default_rng(13)
    wave, pixel = LIBRARY["sheet_waviness"], LIBRARY["pixel_aspect"]
    both = [Term(wave, (2.0,), np.array([-1.1, -2.4])), Term(pixel, (), np.array([-0.1]))]
    columns = tuple(Column(t.model.name, a.name, t.shape) for t in both for a in t.amplitudes)
    columns += tuple(Column(f"like {t.model.name}", n) for t in both for n in "12")
    design = random.normal(size=(2000, len(columns)))
    measured = design[:, :3] @ np.array([-1.1, -2.4, -0.1]) + 0.1 * random.normal(size=2000)
    about = evidence_of(10 * design, 10 * measured, columns)
    nobody, rare = Stated((), np.zeros((0, 0))), 2 * np.log(30.0)
    others = [f"like {t.model.name}" for t in both]
    odds = odds_in(about, both, others, ["same"] * 2, lambda terms: rare * len(terms), nobody)
    assert max(odds) < 0.01
