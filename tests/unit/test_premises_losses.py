"""Lost pictures found by the wall's motion.

None are found where a hand pulls the probe, and true ones at their places.
"""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pipeline.recording.base import Encoder, FrameTable
from stages.premises.losses import Steps, rows_by_motion
from stages.premises.rhythm_of_steps import over_whole_periods
from tests.hand_pulled import RADIUS_MM, Pulled, pulled

# Encoders in readings a second and mm a count; runs in which lost pictures were reported wrongly.
ENCODERS = [(100, 0.0), (10, 0.0), (10, 1.0), (5, 0.0)]
INVENTED = {1: (12, 17, 22, 29, 65, 98, 99, 142, 158, 159, 163, 190), 2: (9, 31, 43, 81, 140)}


@pytest.mark.parametrize("rhythm", [1, 2])
@pytest.mark.parametrize(("encoder_hz", "quantum_mm"), ENCODERS)
def test_a_probe_pulled_by_hand_loses_no_pictures(encoder_hz: float, quantum_mm: float, rhythm: int) -> None:
    """At stops, turns and jerks, 0.5 to 3 % of drawn runs "lost" pictures that were there."""
    kind = {"rhythm": rhythm, "encoder_hz": encoder_hz, "quantum_mm": quantum_mm}
    seeds = (*INVENTED[rhythm], *range(1000, 1010))
    assert [seed for seed in seeds if pulled(seed, **kind).invented()] == []


def test_without_an_encoder_no_loss_is_reported() -> None:
    assert [s for s in range(20) if pulled(s, encoder_hz=0).invented()] == []


def every(k: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.arange(k - 1, 400, k)


@pytest.mark.parametrize("encoder", [(100, 0.0), (10, 0.0), (100, 2.0)], ids=str)
@pytest.mark.parametrize("k", [3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("rhythm", [1, 2])
def test_every_kth_picture_lost_is_found_at_its_place(
    rhythm: int, k: int, encoder: tuple[float, float]
) -> None:
    """Every third one was not found, neither if every second picture is lit nor if all are."""
    if (rhythm, k) == (2, 4):
        pytest.skip("all steps are alike: a picture in three is lit, and nothing tells of losses")
    kind = {"rhythm": rhythm, "encoder_hz": encoder[0], "quantum_mm": encoder[1]}
    found, true = pulled(3, lost=every(k), steady=True, errors=0.5, **kind).over_steps()
    np.testing.assert_array_equal(found, true)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rhythm", [1, 2])
def test_bursts_and_pairs_of_losses_are_found_in_a_moving_run(rhythm: int, seed: int) -> None:
    lost = np.concatenate([k + np.arange(2 + seed % 2) * rhythm for k in range(40 + seed, 380, 60)])
    lost = np.unique(np.concatenate([lost + j for j in range(rhythm)]))
    found, true = pulled(seed, rhythm=rhythm, lost=lost, steady=True, errors=0.5).over_steps()
    np.testing.assert_array_equal(found, true)


def test_a_noise_filter_that_holds_texture_back_at_first_loses_nothing() -> None:
    """Behind a noise filter the first steps are too short: 2 lost pictures were reported there."""
    run = pulled(3, steady=True, errors=0.2, frames=170)
    held = np.array(
        [0.14, 0.22, 0.652, 0.464, 0.43, 0.42, 0.4, 0.427, 0.408, 0.423, 0.447, 0.453, 0.47, 0.511]
    )
    size = run.steps.size.copy()
    size[: len(held)] *= held / 0.64
    assert replace(run, steps=replace(run.steps, size=size)).invented() == 0


def test_the_rhythm_does_not_depend_on_the_last_step() -> None:
    """With steps over 2 and 3 pictures in turn, the last one made 3 the rhythm, and losses of the others."""
    pictures, size = np.tile([2, 3], 20), np.tile([2.0, 4.0], 20)
    for end in (39, 40):
        rhythm, over = over_whole_periods(pictures[-end:], size[-end:], 5)
        assert rhythm == 2
        np.testing.assert_array_equal(over, pictures[-end:] == 3)


@pytest.mark.parametrize("end", [39, 40])
def test_an_irregular_sequence_of_lights_loses_nothing(end: int) -> None:
    """With laser, led, led the steps span 1 and 2 pictures and are as long: no period is broken."""
    pictures = np.tile([1, 2], 20)[-end:]
    rhythm, over = over_whole_periods(pictures, 0.5 * pictures, 3)
    assert (rhythm, over.any()) == (3, False)


@pytest.mark.parametrize("sense", [1, -1])
def test_a_run_that_is_faster_after_a_gap_loses_nothing(sense: int) -> None:
    """At the end of a gauge, after pictures without motion, one step at a new speed counted as 8 pictures."""
    run = pulled(5, rhythm=4, frames=240, steady=True)
    steps, encoder = run.steps, run.encoder
    assert encoder is not None
    gap_s = steps.end[-6] / 30
    faster = np.where(np.arange(len(steps.end)) > len(steps.end) - 6, 3, 1)
    kept = np.r_[np.arange(len(faster) - 6), len(faster) - 1]
    way = encoder.distance_mm + 2 * np.maximum(encoder.distance_mm - 30 * gap_s, 0)
    went = Steps(steps.start[kept], steps.end[kept], sense * (steps.size * faster)[kept])
    assert replace(run, steps=went, encoder=replace(encoder, distance_mm=sense * way)).invented() == 0


@pytest.mark.parametrize("narrower", [1.0, 1.7, 1 / 1.7])
def test_behind_a_reducer_losses_are_found_and_none_wrongly(narrower: float) -> None:
    """With one radius for the whole pipe the encoder confirmed a loss where the bore is wider."""

    def reduced(run: Pulled) -> Pulled:
        factor = np.where(run.true_row > 200, narrower, 1.0)
        steps = replace(run.steps, size=run.steps.size * factor[run.steps.end])
        return replace(run, steps=steps, radius_mm=RADIUS_MM / factor)

    assert [seed for seed in range(20) if reduced(pulled(seed)).invented()] == []
    lost = np.array([100, 101, 300, 301])
    found, true = reduced(pulled(1, lost=lost, steady=True, errors=0.5)).over_steps()
    np.testing.assert_array_equal(found, true)


@pytest.mark.parametrize("first", [3, 4, 391, 393])
def test_near_the_end_pictures_are_lost_if_the_table_has_rows_for_them(first: int) -> None:
    """Four lost near the end were reported as a video that ends early, and all later times were wrong."""
    run = pulled(5, lost=first + np.arange(4), steady=True, errors=0.5)
    listed = FrameTable(np.arange(400), np.arange(400) / 30, np.full(400, "led"))
    found, true = replace(run, table=listed).over_steps()
    np.testing.assert_array_equal(found, true)


@pytest.mark.parametrize("frames", [12, 15, 20, 30])
@pytest.mark.filterwarnings("error")
def test_a_probe_that_stands_in_a_short_run_loses_nothing(frames: int) -> None:
    """The mean over no moving steps was taken, with a warning of NumPy in a quarter of such runs."""
    for seed in range(40):
        size = 0.001 * np.random.default_rng(seed).standard_normal(frames)
        at = np.arange(frames + 1)
        table = FrameTable(at, at / 30, np.full(frames + 1, "led"))
        row = rows_by_motion(at, Steps(at[:-1], at[1:], size), 1, table, None, np.ones(frames + 1))
        np.testing.assert_array_equal(row, at)


def test_memory_does_not_grow_with_the_square_of_a_run() -> None:
    """For half an hour at 30 pictures a second premises would have taken 12 GB."""
    run = pulled(1, frames=8000, rhythm=1)
    tracemalloc.start()
    run.rows()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1000 * 8 * 8000


def test_one_reading_with_an_absurd_time_is_ignored() -> None:
    """A first reading at 0 before present-day times asked for 380 GB."""
    run = pulled(3)
    assert run.encoder is not None
    wild = replace(run.encoder, time_s=run.encoder.time_s + 1.7e9)
    wild = replace(wild, time_s=np.append(0.0, wild.time_s), distance_mm=np.append(0.0, wild.distance_mm))
    today = replace(run.table, time_s=run.table.time_s + 1.7e9)
    assert replace(run, encoder=wild, table=today).invented() == 0


@pytest.mark.parametrize("batch", [4, 8])
def test_an_encoder_read_in_bursts_confirms_no_loss(batch: int) -> None:
    """It shows no speed, and every jerk of the probe counted as lost pictures."""
    speed = np.ones(460)
    speed[[110, 180, 250, 320, 380]] = 3.0
    way, at = np.cumsum(speed), np.arange(400)
    # Two readings a picture arrive together, a millisecond apart, and are stamped at arrival.
    read = np.arange(0, 459, 0.5)
    arrived = np.ceil(read / batch) * batch
    nth = np.arange(len(read)) - np.searchsorted(arrived, arrived)
    encoder = Encoder(arrived / 30 + nth * 1e-3 - 1, np.interp(read, np.arange(460), way))
    way = way[30:430]
    table = FrameTable(at, at / 30, np.full(400, "led"))
    row = rows_by_motion(at, Steps(at[:-1], at[1:], np.diff(way) / 50), 1, table, encoder, np.ones(400), 50.0)
    np.testing.assert_array_equal(row, at)
