"""Work shared among threads: order, errors at their place, and a limit on what is made ahead."""

import threading

import pytest

from pipeline.system.parallel import in_threads, side_by_side
from tests.patience import patience


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_come_in_order_and_from_other_threads(threads: int) -> None:
    found = list(in_threads(lambda k: (k * k, threading.get_ident()), range(50), threads))
    assert [square for square, _ in found] == [k * k for k in range(50)]
    assert threading.get_ident() not in {thread for _, thread in found}


def test_two_items_are_made_at_the_same_time() -> None:
    meeting = threading.Barrier(2, timeout=patience(60))
    assert sorted(in_threads(lambda k: meeting.wait(), range(2), 2)) == [0, 1]


def test_an_error_is_raised_at_its_place_and_the_rest_is_not_started() -> None:
    taken = []

    def items():
        for k in range(1000):
            taken.append(k)
            yield k

    made = in_threads(lambda k: 1 // (5 - k), items(), 2)
    assert [next(made) for _ in range(5)] == [0, 0, 0, 0, 1]
    with pytest.raises(ZeroDivisionError):
        next(made)
    assert len(taken) < 12


def test_threads_end_with_the_caller() -> None:
    before = threading.active_count()
    made = in_threads(lambda k: k, range(1000), 3)
    next(made)
    made.close()
    assert threading.active_count() == before


def test_a_few_calls_run_at_the_same_time_the_first_in_the_calling_thread() -> None:
    meeting = threading.Barrier(2, timeout=patience(60))
    by = side_by_side(lambda k: (meeting.wait() >= 0, k, threading.get_ident()), (3, 7))
    assert [k for _, k, _ in by] == [3, 7]
    assert by[0][2] == threading.get_ident() != by[1][2]


@pytest.mark.parametrize("wrong", [0, 1])
def test_an_error_of_any_of_them_is_raised(wrong: int) -> None:
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda k: 1 // (k - wrong), (0, 1))
