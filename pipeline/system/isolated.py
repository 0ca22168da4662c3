"""Calls a function in a process of its own: a native library that hangs or crashes takes nothing with it."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

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
