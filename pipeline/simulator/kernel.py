"""How the renderer's kernels are compiled: without the interpreter's lock, kept on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

Function = Callable[..., Any]


def kernel(function: Function) -> Function:
    """Compile a kernel that makes no arrays, into whatever calls it.

    Called as functions, kernels would spend most of their time on handing over their many arrays. Counting
    references to these is left out too: with it a frame takes three times as long. Numba has no public name
    for that, so the lock pins the version this was tried with.
    """
    compiled: Function = njit(
        cache=True, nogil=True, error_model="numpy", forceinline=True, _nrt=False
    )(function)  # fmt: skip
    return compiled
