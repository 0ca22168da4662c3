"""Imports of native libraries that need help on a bare machine."""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from types import ModuleType

import libusb_package


def give_back_memory() -> None:
    """Return to the system what was freed: the GNU C library keeps it for each thread by itself."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


@cache
def open3d() -> ModuleType:
    """Return the module open3d, imported when first asked for.

    It is linked to libusb-1.0; the package `libusb-package` brings that, so no system package is needed.
    """
    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d as module

    return module
