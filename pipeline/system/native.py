"""Imports of native libraries that need help on a bare machine."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType

import libusb_package

# With these open3d draws in notebooks, which nothing here does: half of its import, and 40 MiB.
_NOTEBOOKS = ("dash", "plotly", "plotly.graph_objects")


# Options of the GNU C library's mallopt and their values: blocks below 32 MiB, its largest limit, are taken
# from memory that the process has; that is kept however much of it is free; threads share two parts of it, as
# many as work at a time on two cores. By default each thread has a part of its own, in which freed memory
# waits for that thread alone.
_MMAP_THRESHOLD, _TRIM_THRESHOLD, _ARENA_MAX = -3, -1, -8
_KEEP = {_MMAP_THRESHOLD: 32 << 20, _TRIM_THRESHOLD: (1 << 31) - 1, _ARENA_MAX: 2}


def keep_freed_memory() -> None:
    """Keep freed memory for what is allocated next, until `give_back_memory`.

    Otherwise an array of some megabytes is a new mapping, whose pages the system clears one by one at their
    first use: 4 to 9 % of the processor time of texture and defects. Given back after every stage, it took
    1.5 of 27 s of a run (open-1), for 307 thousand page faults in place of 114 thousand.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        for option, value in _KEEP.items():
            mallopt(option, value)


def give_back_memory() -> None:
    """Return freed memory to the system; the GNU C library would keep it, for each thread apart."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


@cache
def open3d() -> ModuleType:
    """Return the module open3d, imported when first asked for.

    It is linked to libusb-1.0; the package `libusb-package` brings that, so no system package is needed.
    """
    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    with _without(_NOTEBOOKS):
        import open3d as module
    return module


class _Absent(ModuleType):
    """Stands for a module of which nothing is used."""

    def __getattr__(self, name: str) -> None:
        if name.startswith("__"):
            raise AttributeError(name)


@contextmanager
def _without(names: tuple[str, ...]) -> Iterator[None]:
    """Leave modules out of what is imported meanwhile."""
    absent = [name for name in names if name not in sys.modules]
    sys.modules.update({name: _Absent(name) for name in absent})
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]
