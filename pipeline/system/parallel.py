"""Work in threads, its results in order whatever their number; calls in child processes; Ctrl-C as a wish."""

from __future__ import annotations

import ctypes
import pickle
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from types import FrameType
from typing import ParamSpec, TypeVar, cast

import cv2
from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Made = TypeVar("Made")
# Items for each thread that are made before they are asked for.
_AHEAD = 2
_BESIDE = ThreadPoolExecutor(1 << 10, "beside")
"""Threads of `side_by_side`. Idle ones are taken first, since starting one costs as much as much of the work
given to it; there may be so many that calls within calls never wait for each other."""


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


def side_by_side(function: Callable[[Item], Made], items: Sequence[Item]) -> list[Made]:
    """Return ``function`` of a few items, the first on the caller's thread, each other on one of its own."""
    others = [_BESIDE.submit(function, item) for item in items[1:]]
    try:
        first = function(items[0])
    finally:
        wait(others)
    return [first, *(other.result() for other in others)]


@contextmanager
def one_library_thread() -> Iterator[None]:
    """Let linear algebra and OpenCV run on one thread meanwhile.

    BLAS splits sums among its threads, so that their number would show in a result's last digits: the
    covariance of a corrected probe has other bytes with two threads than with one. OpenCV's results are the
    same, but for pictures this small waking its threads costs more than they save: stages work in threads
    themselves.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1, "blas"):
            yield
    finally:
        cv2.setNumThreads(threads)


P = ParamSpec("P")
R = TypeVar("R")

# Libraries print to descriptor 1, so the answer goes out through a copy of it.
_CHILD = """
import os, pickle, sys
answer = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)
sys.path[:] = pickle.load(sys.stdin.buffer)
function, arguments, named = pickle.load(sys.stdin.buffer)
try:
    result = (True, function(*arguments, **named))
except Exception as error:
    result = (False, error)
pickle.dump(result, answer, protocol=5)
answer.close()
os._exit(0)
"""
# Characters of a dead process' error output that the exception quotes.
_STDERR_TAIL = 400


class TimeLimitError(Exception):
    """The call took longer than it may; its process was ended."""


class CrashError(Exception):
    """The process of the call died without an answer."""


def call_isolated(
    time_limit_s: float, function: Callable[P, R], /, *arguments: P.args, **named: P.kwargs
) -> R:
    """Return ``function(*arguments, **named)`` from a child process.

    ``function`` is module level; arguments and result can be pickled. What it raises is raised here.

    Raises
    ------
    TimeLimitError
        After ``time_limit_s`` seconds.
    CrashError
        When the process dies.
    """
    question = pickle.dumps(sys.path, protocol=5) + pickle.dumps((function, arguments, named), protocol=5)
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CHILD],
            input=question,
            capture_output=True,
            timeout=time_limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise TimeLimitError(f"{function.__name__} took longer than {time_limit_s:g} s") from None
    if done.returncode or not done.stdout:
        said = done.stderr.decode(errors="replace")[-_STDERR_TAIL:].strip()
        raise CrashError(f"{function.__name__} ended with status {done.returncode}: {said}")
    good, result = pickle.loads(done.stdout)
    if not good:
        raise result
    return cast(R, result)


_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """Have the system end this process when its parent is lost; for a child, before it starts.

    Elsewhere than on Linux nothing is done.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


@contextmanager
def stop_wish() -> Iterator[threading.Event]:
    """Yield an event that is set by the first SIGINT or SIGTERM; the second acts as it always did.

    Outside the main thread, where signals cannot be caught, the event is never set.
    """
    wish = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield wish
        return
    former = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def note(number: int, frame: FrameType | None) -> None:
        wish.set()
        signal.signal(number, former[signal.Signals(number)])

    for number in former:
        signal.signal(number, note)
    try:
        yield wish
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
