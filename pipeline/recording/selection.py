"""Selecting frames by number, for every kind of source."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

import numpy as np

from pipeline.recording.base import Int

Item = TypeVar("Item")
Made = TypeVar("Made")
_THREADS = 2
_AHEAD = 4


def ascending(frames: Sequence[int] | Int) -> Int:
    """Return frame numbers as an array; raises ValueError unless they ascend from 0 or more."""
    wanted = np.asarray(frames, np.int64)
    if wanted.size and (np.any(np.diff(wanted) <= 0) or wanted[0] < 0):
        raise ValueError("frame numbers must ascend and not be negative")
    return wanted


def complete(wanted: Int, found: Iterator[tuple[int, Item]]) -> Iterator[tuple[int, Item | None]]:
    """Yield every wanted frame in order, None for those that ``found``, ascending too, passes over."""
    pending = iter(wanted.tolist())
    due = next(pending, None)
    for number, item in found:
        while due is not None and due < number:
            yield due, None
            due = next(pending, None)
        if number == due:
            yield number, item
            due = next(pending, None)
        if due is None:
            return
    while due is not None:
        yield due, None
        due = next(pending, None)


def decoded_ahead(
    items: Iterator[tuple[int, Item]], decode: Callable[[Item], Made]
) -> Iterator[tuple[int, Made]]:
    """Yield (number, decoded item) in order, decoding a few ahead on other threads."""
    ahead: deque[tuple[int, Future[Made]]] = deque()
    with ThreadPoolExecutor(_THREADS) as pool:
        for number, item in islice(items, _AHEAD):
            ahead.append((number, pool.submit(decode, item)))
        while ahead:
            number, made = ahead.popleft()
            yield number, made.result()
            for later, item in islice(items, 1):
                ahead.append((later, pool.submit(decode, item)))
