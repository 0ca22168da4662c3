"""An iteration run on a thread of its own, so that it goes on while its items are worked on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")


def in_background(items: Iterator[tuple[int, Item]], ahead: int) -> Iterator[tuple[int, Item]]:
    """Yield ``items`` in order while one thread makes up to ``ahead`` of the next ones.

    What making an item raises is raised here, in its place.
    """
    with ThreadPoolExecutor(1) as pool:
        coming = deque(pool.submit(next, items, None) for _ in range(ahead))
        try:
            while (item := coming.popleft().result()) is not None:
                coming.append(pool.submit(next, items, None))
                yield item
        finally:
            pool.shutdown(cancel_futures=True)
