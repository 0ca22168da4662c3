"""Light that a codec repeats in later pictures.

It is detected by the finest structure of rings, and is part of the wall's σ.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from pipeline.adjustment.held_over import held_over
from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Float
from stages.accumulate.grid import MapGrid, RingColumns, gridded
from stages.accumulate.held import warn_of_held

if TYPE_CHECKING:
    from pipeline.machine.stage import Context

HELD, SAMPLE_MM = 0.7, 0.2


def rings_of(held: float, shape: tuple[int, int], seed: int = 1) -> Float:
    """Return values (F, A) of unit variance, each ``held`` times those of the ring before plus new noise."""
    random = np.random.default_rng(seed)
    rings = [random.standard_normal(shape[1])]
    for _ in range(shape[0] - 1):
        rings.append(held * rings[-1] + np.sqrt(1 - held**2) * random.standard_normal(shape[1]))
    return np.array(rings)


def found_in(held: float, step_mm: float = 1.2) -> HeldOver:
    """Return the result for such rings at such distances, on a wall of wider shapes than those compared."""
    values = rings_of(held, (120, 720))
    wall = 5 * np.sin(np.linspace(0, 8 * np.pi, 720))
    return held_over([values + wall], step_mm * np.arange(120), SAMPLE_MM)


@pytest.mark.parametrize("held", [0.0, 0.4, HELD])
def test_the_correlation_is_that_of_the_rings(held: float) -> None:
    # 120 rings of some 400 independent samples: the correlation errs by 0.005, that of distant rings by 0.01
    assert found_in(held).likeness == pytest.approx(held ** np.arange(17), abs=0.03)


def test_rings_are_compared_up_to_the_distance_at_which_nothing_is_shared() -> None:
    assert found_in(0.0).rings == 1
    assert 0.7 ** found_in(HELD).rings == pytest.approx(0.1, abs=0.04)


def test_rings_of_a_standing_probe_are_not_taken_for_repeated_light() -> None:
    assert found_in(0.9, step_mm=0.01).rings == 1


def test_missing_samples_and_short_passes_give_no_correlation() -> None:
    values = rings_of(0.0, (30, 720))
    values[:, 100:200] = np.nan
    assert held_over([values], 1.2 * np.arange(30), SAMPLE_MM).likeness[1] < 0.05
    assert held_over([values[:1]], np.zeros(1), SAMPLE_MM).rings == 0


def test_a_mean_of_rings_with_shared_errors_is_less_sure() -> None:
    """The formula is compared with drawn rings."""
    width, apart = 1.5, np.arange(-8, 9)
    weight = np.exp(-0.5 * (apart / width) ** 2) / np.exp(-0.5 * (apart / width) ** 2).sum()
    drawn = rings_of(HELD, (17, 20000))
    gain = HeldOver(HELD ** np.arange(17.0)).gain_in_mean(width)
    assert np.std(weight @ drawn) / np.linalg.norm(weight) == pytest.approx(gain, rel=0.03)


@pytest.mark.parametrize("held", [0.15, 0.45])
def test_findings_get_a_warning_where_rings_are_correlated(held: float) -> None:
    told: list[str] = []
    context = SimpleNamespace(report=lambda *_: None, warn=told.append)
    warn_of_held(HeldOver(held ** np.arange(17.0)), True, cast("Context", context))
    assert [w for w in told if "45 % of the line's finest structure" in w] == told
    assert len(told) == (held > 0.3)


@pytest.mark.parametrize("predicted", [True, False])
def test_the_codec_is_not_the_cause_where_it_codes_each_picture_alone(predicted: bool) -> None:
    """Rings of pictures stored as single JPEGs shared 24 and 33 %: "the codec repeats light"."""
    told: list[str] = []
    context = SimpleNamespace(report=lambda *_: None, warn=told.append)
    warn_of_held(HeldOver(0.33 ** np.arange(17.0)), predicted, cast("Context", context))
    assert ("the codec, or a noise filter, repeats" in told[0]) == predicted
    assert ("the codec, which keeps each picture apart" in told[0]) != predicted
    assert "same places of the image" in told[0]


def columns_with(held: float, sigma_mm: float) -> RingColumns:
    """Return rings 0.6 mm apart on a round wall in 720 columns, which state a third of their errors.

    Errors are 12° wide, as of a codec's blocks: roughness from cell to cell does not show them.
    """
    error = sigma_mm * np.repeat(rings_of(held, (150, 30)).T, 24, axis=0)
    distance = np.broadcast_to(0.6 * np.arange(150), error.shape).copy()
    variance = np.full(error.shape, (sigma_mm / 3) ** 2)
    return RingColumns(distance, 50 + error, variance, np.zeros_like(error), np.ones(error.shape, np.int64))


@pytest.mark.parametrize(("held", "told"), [(0.0, True), (HELD, True), (HELD, False)])
def test_sigma_is_that_of_repeated_errors(held: float, told: bool) -> None:
    """Estimated by the scatter of neighbouring rings it is too small; their correlation must be detected."""
    grid = MapGrid(0.5 * np.arange(4, 170), 2 * np.pi / 720 * np.arange(720) - np.pi)
    alike = HeldOver(held ** np.arange(17.0) if told else np.eye(17)[0])
    radius, sigma, *_ = gridded(columns_with(held, 0.05), grid, 0.3, 3.0, alike)
    stated = float(np.median(sigma)) / float(np.std(radius - 50))
    if told:
        assert 0.85 < stated < 1.2
    else:
        assert stated < 0.75


def test_shared_error_is_added_equally_to_all_cells_and_leaves_a_pit_detectable() -> None:
    """As a factor on each cell's σ it was largest where a pit's flanks scatter.

    A real pit of 1 mm was hidden.
    """
    columns = columns_with(HELD, 0.05)
    along, around = (columns.distance_mm - 45) / 6, (np.arange(720)[:, None] - 360) / 10
    columns.radius_mm[:] += np.exp(-0.5 * (along**2 + around**2)) * (
        1 + 0.3 * np.sin(5 * columns.distance_mm)
    )
    grid = MapGrid(0.5 * np.arange(4, 170), 2 * np.pi / 720 * np.arange(720) - np.pi)
    told, untold = (
        gridded(columns, grid, 0.3, 3.0, HeldOver(likeness))[1]
        for likeness in (HELD ** np.arange(17.0), np.eye(17)[0])
    )
    pit, wall = (slice(70, 100), slice(350, 370)), (slice(70, 100), slice(0, 200))
    # otherwise the case would show nothing
    assert np.median(untold[pit]) > 1.5 * np.median(untold[wall])
    added = told**2 - untold**2
    assert np.median(added[pit]) == pytest.approx(np.median(added[wall]), rel=1e-3)
    assert np.median(added[wall]) > np.median(untold[wall]) ** 2


def test_rings_that_share_light_count_as_fewer() -> None:
    """Three rings of one coded block confirmed a false gouge of 6.5 ± .5 mm at .98."""
    for count in (1, 2, 3, 20):
        assert HeldOver(np.array([1.0, 0.09, 0.06, 0.0])).independent(count) == count
    coded = HeldOver(0.8 ** np.arange(17))
    assert [coded.independent(count) for count in (1, 2, 3, 9, 40)] == [1, 1, 1, 2, 5]
    means = [rings_of(0.8, (9, 1), seed).mean() for seed in range(3000)]
    assert round(1 / float(np.var(means))) == coded.independent(9)


@pytest.mark.parametrize("same", [0.0, 0.65])
@pytest.mark.parametrize("held", [0.0, 0.6, 0.9])
def test_what_is_the_same_in_all_rings_is_not_repeated_light(held: float, same: float) -> None:
    """Fixed rows of a sensor beside new noise gave correlations .29, .29, .29, ..., taken for repetition."""
    values = rings_of(held, (120, 720)) + same * np.random.default_rng(2).standard_normal(720)
    found = held_over([values], 1.2 * np.arange(120), SAMPLE_MM)
    assert found.more_than_usual == (held + same > 0)
    assert found.handed_on == pytest.approx(held, abs=0.05)


@pytest.mark.parametrize("likeness", [[1.0], [1, 0.25], [1, 1], [1, 0.3, 0.3], [1, 0.21, 0.2], [1, 1, 1, 1]])
def test_the_repeated_share_of_light_is_below_one(likeness: list[float]) -> None:
    assert 0 <= HeldOver(np.array(likeness)).handed_on < 1


def test_new_noise_hides_nothing_of_the_repeated_light() -> None:
    likeness = np.r_[1.0, 0.4 * 0.8 ** np.arange(16)]
    assert HeldOver(likeness).handed_on == pytest.approx(0.8, abs=0.03)
    # A codec that repeats most of a picture once, and no more.
    assert HeldOver(np.array([1, 0.79, 0.3, 0.1, 0.05, 0])).handed_on == pytest.approx(0.79, abs=0.03)


def drifting(rings: int, held: float, fixed: float, seed: int = 1) -> tuple[Float, Float]:
    """Return values (F, A) and places (F, A), px, of a line that drifts over errors fixed to the image.

    Of unit variance, ``fixed`` is that of the errors, which change within a pixel; of the rest, ``held`` is
    handed on from ring to ring.
    """
    random, fine = np.random.default_rng(seed), 10
    place = 12 + 2 * np.sin(np.linspace(0, 9, rings))[:, None] + 0.5 * np.sin(np.linspace(0, 6.28, 720))
    place = place + 0.3 * random.standard_normal((rings, 1))
    errors = gaussian_filter1d(random.standard_normal((24 * fine, 720)), 0.5 * fine, axis=0)
    at = np.rint(fine * place).astype(int)
    of_image = np.sqrt(fixed) * errors[at, np.arange(720)] / errors.std()
    return of_image + np.sqrt(1 - fixed) * rings_of(held, (rings, 720), seed + 1), place


@pytest.mark.parametrize("held", [0.0, 0.5, 0.8])
@pytest.mark.parametrize("fixed", [0.0, 0.4])
def test_errors_of_the_image_are_not_light_of_earlier_pictures(held: float, fixed: float) -> None:
    """Single JPEGs of a drifting line gave .35, .28, .23, ...: three rings counted as one."""
    values, place = drifting(60, held, fixed)
    found = held_over([values], 1.2 * np.arange(60), SAMPLE_MM, place)
    both = fixed + (1 - fixed) * held
    assert fixed == 0 or found.likeness[1] > 0.7 * both
    assert found.repeated is not None or fixed == 0
    light = found.likeness if found.repeated is None else found.repeated
    assert light[1:5] == pytest.approx(held ** np.arange(1, 5), abs=0.08)
    assert found.more_than_usual == (held > 0)
    assert found.independent(3) == (3 if held == 0 else 2 if held == 0.5 else 1)
    assert found.handed_on == pytest.approx(held, abs=0.1)


def test_few_rings_do_not_tell_errors_of_the_image_apart() -> None:
    values, place = drifting(16, 0.0, 0.4)
    found = held_over([values], 1.2 * np.arange(16), SAMPLE_MM, place)
    assert found.repeated is None
    assert found.independent(3) < 3


def test_light_handed_on_to_every_second_ring_is_detected() -> None:
    """In drawn HEVC of alternating lights rings shared .04, .47, .02, .36, ...: it counted as .04."""
    values = np.stack([rings_of(0.7, (60, 720), seed) for seed in (3, 4)], 1).reshape(120, 720)
    found = held_over([values], 1.2 * np.arange(120), SAMPLE_MM)
    assert found.likeness[1:4] == pytest.approx([0.0, 0.7, 0.0], abs=0.03)
    assert found.more_than_usual
    assert [found.independent(count) for count in (2, 8)] == [2, 3]


@pytest.mark.parametrize("repeated", [0.05, 0.5])
def test_only_repeated_light_is_warned_of_where_it_is_told_apart(repeated: float) -> None:
    told: list[str] = []
    context = SimpleNamespace(report=lambda *_: None, warn=told.append)
    lags = np.arange(17.0)
    warn_of_held(HeldOver(0.6**lags, repeated**lags), True, cast("Context", context))
    assert len(told) == (repeated > 0.1)
    assert not any("places of the image" in w for w in told)
