"""Selecting frames by number, for every kind of source."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from pipeline.arrays import Int
from pipeline.system.threads import in_threads

Item = TypeVar("Item")
Made = TypeVar("Made")
_THREADS = 2


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
    return in_threads(lambda item: (item[0], decode(item[1])), items, _THREADS)
