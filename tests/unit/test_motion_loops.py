"""Loop closure where the probe comes back: all true loops are closed, and no wrong one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.machine.scratch import Scratch
from stages.motion import estimate_motion
from stages.motion.loops.loop_closure import LoopReport, ShiftPredictor, close_loops
from stages.motion.loops.revisits import (
    Passage,
    Revisit,
    WallFeatures,
    bands_in_rings,
    choose_revisits,
    texture_at,
    widened,
)
from stages.motion.loops.strip_registration import ExpectedShift, Registration, Verdict, register
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.overlap import StoredStrip
from stages.motion.windows.submap_joining import JoinedRun
from tests.drawn_run import drawn_run, without_encoder
from tests.looped_run import FRAMES, GRID, DrawnView, LoopedRun, looped_run, rough_wall
from tests.quiet import quiet_context

PARAMETERS = MotionParameters.model_validate({"max_track_frames": 40})
WALL = rough_wall()


@pytest.fixture(scope="module")
def run() -> LoopedRun:
    return looped_run()


@pytest.fixture(scope="module")
def closed(run: LoopedRun) -> tuple[JoinedRun, LoopReport]:
    return closing(run, DrawnView(run, WALL, WALL, {}))


def plain_features(passage: Passage) -> WallFeatures:
    return WallFeatures(np.ones(len(passage.frame)), np.zeros(0))


def closing(run: LoopedRun, view: DrawnView, **changes: float) -> tuple[JoinedRun, LoopReport]:
    parameters = PARAMETERS.model_copy(update=changes)
    return close_loops(run.joined, run.passage, plain_features, view, parameters, Scratch())


def gap(run: LoopedRun, joined: JoinedRun) -> tuple[Float, Float, Float]:
    """Return by how much distance, roll and axis differ between the way out and the way back."""
    distance, roll, aside = run.believed(joined)
    there, here = np.arange(10, 150), FRAMES - 1 - np.arange(10, 150)
    off, turned = distance - run.distance_mm, roll - run.roll_rad
    return off[here] - off[there], turned[here] - turned[there], aside[here] - aside[there]


def test_the_drift_between_the_ways_out_and_back_is_removed(
    run: LoopedRun, closed: tuple[JoinedRun, LoopReport]
) -> None:
    joined, loops = closed
    assert len(loops.revisits) >= 6
    assert all(loops.closed)
    before, after = gap(run, run.joined), gap(run, joined)
    assert np.abs(before[0]).max() > 0.5
    assert np.abs(after[0]).max() < 0.15
    assert np.abs(before[1]).max() > 0.002
    assert np.abs(after[1]).max() < 0.001
    assert np.abs(before[2]).max() > 0.1
    assert np.abs(after[2]).max() < 0.05


def test_loops_are_closed_beyond_a_bend() -> None:
    bent = looped_run(curvature_per_mm=2e-3)
    joined, loops = closing(bent, DrawnView(bent, WALL, WALL, {}))
    assert all(loops.closed)
    before, after = gap(bent, bent.joined), gap(bent, joined)
    assert np.abs(before[0]).max() > 0.5
    assert np.abs(after[0]).max() < 0.15
    assert np.abs(after[1]).max() < 0.001
    assert np.abs(before[2]).max() > 0.5
    assert np.abs(after[2]).max() < 0.15


def test_sigma_decreases_and_covers_the_errors(run: LoopedRun, closed: tuple[JoinedRun, LoopReport]) -> None:
    joined, _ = closed
    sigma = [np.sqrt(np.diagonal(j.covariance, axis1=1, axis2=2)) for j in (run.joined, joined)]
    assert np.all(sigma[1] <= sigma[0] + 1e-12)
    assert sigma[1][-1, 2] < 0.5 * sigma[0][-1, 2]
    assert sigma[1][-1, 5] < 0.5 * sigma[0][-1, 5]
    squares = []
    for seed in range(12):
        other = looped_run(seed=seed)
        found, _ = closing(other, DrawnView(other, WALL, WALL, {}), loop_spacing_mm=200.0)
        error = (other.believed(found)[0] - other.distance_mm)[200::40]
        spread = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))[200::40, 2]
        squares.append((error - (other.believed(found)[0] - other.distance_mm)[0]) / spread)
    assert 0.6 < np.sqrt(np.mean(np.square(squares))) < 1.4


def test_with_another_wall_no_loop_is_closed(run: LoopedRun) -> None:
    joined, loops = closing(run, DrawnView(run, WALL, rough_wall(seed=2), {}))
    assert joined is run.joined
    assert set(loops.verdicts) == {Verdict.OTHER}


def test_with_a_wall_without_texture_no_loop_is_closed(run: LoopedRun) -> None:
    bare = np.zeros_like(WALL)
    joined, loops = closing(run, DrawnView(run, bare, bare, {}))
    assert joined is run.joined
    assert set(loops.verdicts) <= {Verdict.PLAIN, Verdict.OTHER}


def test_with_a_wall_that_repeats_itself_no_loop_is_closed(run: LoopedRun) -> None:
    same = rough_wall(repeat_mm=12.0)
    joined, loops = closing(run, DrawnView(run, same, same, {}))
    assert joined is run.joined
    assert set(loops.verdicts) <= {Verdict.REPEATED, Verdict.OTHER}
    assert Verdict.REPEATED in loops.verdicts


def test_equal_welds_at_equal_spacing_are_not_confused(run: LoopedRun) -> None:
    """In a run estimated a whole spacing off, every weld meets the image of another; none may be closed."""
    wall = rough_wall(welds_every_mm=100.0)
    off = {frame: 100.0 for frame in range(FRAMES // 2, FRAMES)}
    joined, loops = closing(run, DrawnView(run, wall, wall, off))
    assert joined is run.joined
    assert not any(loops.closed)
    _, right = closing(run, DrawnView(run, wall, wall, {}))
    assert all(right.closed), "control: with the same welds at their estimated places"


def test_a_few_wrong_places_are_rejected(run: LoopedRun, closed: tuple[JoinedRun, LoopReport]) -> None:
    places = closed[1].revisits
    wrong = {places[2].later: 2.8, places[5].later: -3.2}
    joined, loops = closing(run, DrawnView(run, WALL, WALL, wrong))
    assert [n for n, v in enumerate(loops.verdicts) if v is Verdict.CONTRADICTED] == [2, 5]
    assert sum(loops.closed) == len(places) - 2
    assert np.abs(gap(run, joined)[0]).max() < 0.15


def test_no_loop_is_closed_if_as_many_places_contradict_as_agree(
    run: LoopedRun, closed: tuple[JoinedRun, LoopReport]
) -> None:
    wrong = {p.later: 2.5 * (-1) ** n for n, p in enumerate(closed[1].revisits)}
    joined, loops = closing(run, DrawnView(run, WALL, WALL, wrong))
    assert joined is run.joined
    assert not any(loops.closed)


def test_shift_and_its_sigma_are_right(run: LoopedRun) -> None:
    view, T = DrawnView(run, WALL, WALL, {}), np.eye(4)
    errors = []
    for n, off in enumerate((0.0, 0.4, 0.93, -2.3, 6.1)):
        frame = 100 + n
        T[2, 3] = run.distance_mm[frame]
        earlier = next(view.strips(np.array([frame]), T[None]))
        later = next(DrawnView(run, WALL, WALL, {frame: off}).strips(np.array([frame]), T[None]))
        found = register(
            [StoredStrip.of(earlier)], later, ExpectedShift(np.zeros(2), np.array([20.0, 20.0])), PARAMETERS
        )
        assert found.verdict is Verdict.SAME
        errors.append((found.shift[0] - off / GRID.step_mm) / found.sigma[0])
    assert np.abs(errors).max() < 3
    beyond = register(
        [StoredStrip.of(earlier)], later, ExpectedShift(np.zeros(2), np.array([5.0, 20.0])), PARAMETERS
    )
    assert beyond.verdict is not Verdict.SAME, "further off than possible"


def passage(distance_mm: Float) -> Passage:
    return Passage.of(np.arange(len(distance_mm)), distance_mm, 10.0, 60.0)


def test_places_are_chosen_only_on_a_way_back() -> None:
    out = np.arange(0, 800, 4.0)
    assert not passage(out).seen_again(10).size
    small = np.concatenate([out, out[-1] - np.arange(0, 40, 4.0), np.arange(out[-1] - 40, 1200, 4.0)])
    assert not passage(small).seen_again(10).size, "the wall stayed in view"
    assert not passage(np.zeros(0)).seen_again(10).size
    back = passage(np.concatenate([out, out[::-1]]))
    pairs = back.seen_again(10)
    assert np.abs(np.diff(back.distance_mm[pairs], axis=1)).max() < 4.1
    assert np.all(np.diff(back.frame[pairs], axis=1) > 10)
    third = passage(np.concatenate([out, out[::-1], out]))
    before = [third.number[a] for a, b in third.seen_again(10) if third.number[b] == 2]
    assert np.mean(before) > 0.9, "compared with the pass before, not the first"


def test_welds_are_preferred_as_places_then_texture() -> None:
    out = np.arange(0, 800, 4.0)
    back = passage(np.concatenate([out, out[::-1]]))
    texture = np.where(np.arange(400) == 60, 5.0, 1.0)
    pairs = back.seen_again(10)
    places = choose_revisits(back, pairs, WallFeatures(texture, np.array([355.0])), 100.0, 50)
    assert [p for p in places if p.earlier == (60,)], "the most texture"
    welds = [p for p in places if p.at_weld]
    assert len(welds) in (1, 2)
    assert all(abs(back.distance_mm[p.later] + 35 - 355) <= 12.5 for p in welds)
    assert len(choose_revisits(back, pairs, WallFeatures(texture, np.zeros(0)), 20.0, 5)) == 5
    beside = widened(Revisit((100,), 300, False), back, 40.0)
    assert beside.earlier[0] == 100
    assert len(beside.earlier) == 5
    assert max(abs(back.distance_mm[f] - 400.0) for f in beside.earlier) < 40


def test_bands_are_rings_that_stand_out_around_the_whole_pipe() -> None:
    distance = np.arange(0, 1000, 5.0)
    radius = 50 + 0.01 * np.random.default_rng(0).standard_normal(len(distance)) + 1e-4 * distance
    assert not bands_in_rings(distance, radius).size
    radius[[40, 41]] -= 0.7
    radius[100] = np.nan
    assert bands_in_rings(distance, radius).tolist() == [200.0, 205.0]


def test_texture_is_counted_by_frame() -> None:
    seen = np.zeros(3, [("frame", "i8"), ("sigma", "f8")])
    seen["frame"], seen["sigma"] = [3, 7, 7], [0.5, 1.0, 1.0]
    np.testing.assert_allclose(texture_at(np.array([3, 5, 7]), [seen, seen]), [8.0, 0.0, 4.0])


def test_the_expected_shift_is_learnt_from_place_to_place() -> None:
    """Shifts grow as a random walk, one step a place: the search range stays that of the next step."""
    walk = 100.0 * np.minimum.outer(np.arange(1, 7), np.arange(1, 7))
    predictor = ShiftPredictor(np.kron(walk, np.eye(2)))
    before = predictor.predict(5).reach
    for place in range(5):
        found = Registration(Verdict.SAME, np.array([7.0 * place, -3.0]), np.array([0.1, 0.1]))
        predictor.learn(place, found)
    predictor.learn(4, Registration.refused(Verdict.OTHER))
    expected = predictor.predict(5)
    np.testing.assert_allclose(expected.shift, [28.0, -3.0], atol=0.1)
    assert np.all(expected.reach < 0.5 * before)
    assert expected.allows(np.array([40.0, 20.0]))
    assert not expected.allows(np.array([28.0, 60.0]))


def test_no_loop_is_closed_if_loop_closure_is_off(run: LoopedRun) -> None:
    joined, loops = closing(run, DrawnView(run, WALL, WALL, {}), most_loops=0)
    assert joined is run.joined
    assert not loops.revisits


def test_pictures_forth_and_back_close_loops_and_the_report_says_so() -> None:
    way = np.concatenate([np.arange(0, 110, 2.0), np.arange(110, 0, -2.0)])
    drawn = without_encoder(drawn_run(way, 0.1 * np.sin(np.arange(len(way)) / 20)))
    told: dict[str, float | int | str] = {}

    def tell(name: str, value: float | int | str, unit: str = "") -> None:
        told[name] = value

    windows = {"window_frames": 44, "overlap_frames": 16, "max_track_frames": 20}
    chosen = MotionParameters.model_validate(windows | {"loop_spacing_mm": 20.0})
    context = replace(quiet_context(), report=tell)
    found = estimate_motion(drawn.recording, drawn.probe, drawn.rings, drawn.points, chosen, context)
    compared = told["places where the wall was compared with an earlier pass"]
    assert 3 <= int(compared) == told["loops closed there"]
    off = found.T_pc[:, 2, 3] - drawn.T_pc[:, 2, 3]
    there, here = np.arange(11, 50, 2), len(way) - np.arange(11, 50, 2)
    assert np.abs(off[here] - off[there]).max() < 0.03
    assert np.all(np.linalg.eigvalsh(found.covariance[1:]) > 0)
