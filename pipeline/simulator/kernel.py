"""How the renderer's kernels are compiled: without the interpreter's lock, kept on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

Function = Callable[..., Any]


def owner(function: Function) -> Function:
    """Compile a kernel that makes arrays of its own."""
    return njit(cache=True, nogil=True, error_model="numpy")(function)  # type: ignore[no-any-return]


def kernel(function: Function) -> Function:
    """Compile a kernel that makes no arrays.

    Counting references to the arrays handed through is left out: it takes two thirds of the time.
    """
    return njit(cache=True, nogil=True, error_model="numpy", _nrt=False)(function)  # type: ignore[no-any-return]
