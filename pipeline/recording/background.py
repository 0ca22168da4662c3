"""An iteration run on a thread of its own, so that it goes on while its items are worked on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Pairs = Iterator[tuple[int, Item]]
Coming = Future[tuple[int, Item] | None]


def in_background(items: Pairs[Item], ahead: int) -> Pairs[Item]:
    """Return ``items`` in order; one thread makes up to ``ahead`` of them before they are asked for.

    It starts at once. What making an item raises is raised in the item's place.
    """
    pool = ThreadPoolExecutor(1)
    return _as_made(items, pool, deque(pool.submit(next, items, None) for _ in range(ahead)))


def _as_made(items: Pairs[Item], pool: ThreadPoolExecutor, coming: deque[Coming[Item]]) -> Pairs[Item]:
    try:
        while (item := coming.popleft().result()) is not None:
            coming.append(pool.submit(next, items, None))
            yield item
    finally:
        pool.shutdown(cancel_futures=True)
