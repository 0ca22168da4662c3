"""Iterating in a background thread: order, errors at their place, and an end when the caller stops."""

import threading

import pytest

from pipeline.recording.base import in_background


def numbered(count, error_at=None, made=None):
    for k in range(count):
        if k == error_at:
            raise ValueError("damaged")
        if made is not None:
            made.append((k, threading.get_ident()))
        yield k, k * k


def test_items_come_in_order_and_from_another_thread():
    made = []
    assert list(in_background(numbered(50, made=made), 4)) == [(k, k * k) for k in range(50)]
    assert threading.get_ident() not in {thread for _, thread in made}


def test_an_error_is_raised_at_its_place():
    seen = []
    with pytest.raises(ValueError, match="damaged"):
        seen.extend(k for k, _ in in_background(numbered(9, error_at=5), 3))
    items = in_background(numbered(9, error_at=5), 3)
    assert [next(items)[0] for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(ValueError, match="damaged"):
        next(items)


def test_only_so_many_items_are_made_ahead_and_threads_end_with_the_caller():
    made, before = [], threading.active_count()
    items = in_background(numbered(1000, made=made), 4)
    next(items)
    items.close()
    assert len(made) <= 6
    assert threading.active_count() == before
