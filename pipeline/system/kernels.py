"""Kernels of a first run, compiled by a second process while the run reads its recording.

Numba compiles a kernel when it is first called and keeps it in its cache. In the first run after an
installation, compiling takes longer than the run itself, on one core of two. ``configs/kernels/run.yaml``
lists the kernels and the types of their arguments; a kernel that is not listed there is compiled when it is
first called.
"""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from pipeline.system.parallel import end_with_parent

Kernels = Mapping[str, Mapping[str, str]]
"""By module and function, the types that it is called with, as `type_of` reads them, with ``;`` between."""

_CHILD = """
import os, pickle, sys
os.nice(5)
sys.path[:] = pickle.load(sys.stdin.buffer)
from pipeline.system.kernels import compile_all
compile_all(pickle.load(sys.stdin.buffer))
"""
_TYPE = re.compile(
    r"(?:(?P<times>\d+) \* )?(?P<scalar>\w+)(?:\[(?P<axes>\d)(?P<order>[ACF])(?P<kept> kept)?\])?"
    r"(?: in (?P<names>[\w.]+))?"
)


@contextmanager
def compiled_ahead(kernels: Kernels) -> Iterator[None]:
    """Compile kernels that Numba's cache lacks while the caller works; no result depends on it.

    Where the cache seems to hold all kernels, a thread of this process loads them (0.3 s), so that no stage
    has to wait for that. If Numba refuses what the cache holds, for instance after Numba was updated, the
    thread compiles the kernels again, slower than a second process would. A kernel that cannot be compiled
    ends the compiling; the stage that calls the kernel reports why. A second process that is still compiling
    when the run is done is stopped.
    """
    if all(_is_kept(dispatcher) for dispatcher, _ in _found(kernels)):
        with ThreadPoolExecutor(1, "kernels") as aside:
            aside.submit(compile_all, kernels)
            yield
        return
    process = subprocess.Popen(
        [sys.executable, "-c", _CHILD], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, preexec_fn=end_with_parent,
    )  # fmt: skip
    try:
        if process.stdin is not None:
            with process.stdin as question:
                question.write(pickle.dumps(sys.path) + pickle.dumps(kernels))
        yield
    finally:
        process.terminate()
        process.wait()


def compile_all(kernels: Kernels) -> None:
    """Read kernels from the cache, and compile those that are not there, one after the other."""
    for dispatcher, types in _found(kernels):
        dispatcher.compile(tuple(type_of(word) for word in types.split("; ")))


def type_of(word: str) -> Any:
    """Return Numba's type of an argument.

    Parameters
    ----------
    word : str
        ``float64``; ``float64[2C]``, an array by axes and order, ``float64[2C kept]`` where it must not be
        written; ``3 * uint8[2C]``, a tuple of three; ``4 * float64 in module.Name``, a named one.
    """
    from numba import types

    found = _TYPE.fullmatch(word)
    if found is None:
        raise ValueError(f"{word} is no type of an argument")
    kind = getattr(types, found["scalar"])
    if found["axes"]:
        kind = types.Array(kind, int(found["axes"]), found["order"], readonly=bool(found["kept"]))
    if found["names"]:
        module, _, name = found["names"].rpartition(".")
        return types.NamedUniTuple(kind, int(found["times"]), getattr(import_module(module), name))
    return types.UniTuple(kind, int(found["times"])) if found["times"] else kind


def _found(kernels: Kernels) -> Iterator[tuple[Any, str]]:
    for module, functions in kernels.items():
        for name, types in functions.items():
            yield getattr(import_module(module), name), types


def _is_kept(dispatcher: Any) -> bool:
    """Return whether the cache holds something of a kernel that was compiled since its file was changed.

    Whether Numba will take it (its own version, the processor, the types) is not looked at.
    """
    function = dispatcher.py_func
    file = Path(function.__code__.co_filename)
    kept = Path(dispatcher.stats.cache_path).glob(f"{file.stem}.{function.__qualname__}-*.nbi")
    return any(index.stat().st_mtime >= file.stat().st_mtime for index in kept)
