"""Work shared among threads, its results in order whatever their number."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Made = TypeVar("Made")
_AHEAD = 2


def in_threads(function: Callable[[Item], Made], items: Iterable[Item], threads: int) -> Iterator[Made]:
    """Yield ``function`` of every item in order; a few for each thread are made before they are asked for.

    What making an item raises is raised in the item's place. ``items`` are taken on the caller's thread.
    """
    ahead: deque[Future[Made]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        for item in items:
            ahead.append(pool.submit(function, item))
            if len(ahead) >= _AHEAD * threads:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let linear algebra run on one thread meanwhile.

    BLAS splits sums among its threads, so that their number would show in a result's last digits: the
    covariance of a corrected probe has other bytes with two threads than with one.
    """
    with threadpool_limits(1, "blas"):
        yield
