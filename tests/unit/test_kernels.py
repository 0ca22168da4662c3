"""Kernels of a first run are compiled by a second process."""

from __future__ import annotations

import inspect
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import pytest
from numba import types

from pipeline.cli import kernels_of_a_run
from pipeline.system import kernels
from pipeline.system.kernels import compile_all, compiled_ahead, type_of
from tests.shared_data import PROJECT_ROOT

KERNEL = """
import numba

@numba.njit(cache=True)
def twice(values, factor):
    return values * factor
"""
MODULE = "kernel_of_a_test"
LISTED = {MODULE: {"twice": "float64[1C]; int64"}}


@pytest.fixture
def kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / f"{MODULE}.py").write_text(KERNEL)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, MODULE, raising=False)


def test_every_listed_kernel_exists_and_takes_as_many_arguments_as_listed() -> None:
    for module, functions in kernels_of_a_run().items():
        for name, words in functions.items():
            wanted = [type_of(word) for word in words.split("; ")]
            function = getattr(import_module(module), name).py_func
            assert len(wanted) == len(inspect.signature(function).parameters), f"{module}.{name}"


def test_every_listed_kernel_takes_the_types_listed() -> None:
    """One that does not would end the second process; the run would have to compile the rest."""
    compile_all(kernels_of_a_run())


def test_a_run_starts_without_the_part_of_scipy_that_loads_slowly() -> None:
    """Two parts of SciPy took a fifth of the time of all imports, for a tail of Student's t and a filter."""
    told = "import sys, stages.catalogue, pipeline.export.catalogue, pipeline.cli; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", told], cwd=PROJECT_ROOT, capture_output=True, text=True, check=True
    )
    assert "scipy.ndimage" in loaded.stdout.split(), "the control"
    assert not {"scipy.stats", "scipy.signal"} & set(loaded.stdout.split())


def test_types_are_read() -> None:
    assert type_of("float32[2A]") == types.Array(types.float32, 2, "A")
    assert type_of("float64[3C kept]") == types.Array(types.float64, 3, "C", readonly=True)
    assert type_of("2 * uint8[1C]") == types.UniTuple(types.Array(types.uint8, 1, "C"), 2)
    with pytest.raises(ValueError, match="no type"):
        type_of("float64[2]")


def test_compiled_kernels_are_kept_and_need_no_second_process(
    kernel: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[object] = []
    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: started.append(a) or popen(*a, **k))
    with compiled_ahead(LISTED):
        assert started, "the cache was empty"
    compile_all(LISTED)
    assert list(tmp_path.glob("__pycache__/*.nbi"))
    started.clear()
    read: list[object] = []
    monkeypatch.setattr(kernels, "compile_all", read.append)
    with compiled_ahead(LISTED):
        assert not started
    assert read == [LISTED], "kept kernels are read in advance"


def test_the_second_process_fills_the_cache(kernel: None, tmp_path: Path) -> None:
    with compiled_ahead(LISTED):
        for _ in range(600):
            if list(tmp_path.glob("__pycache__/*.nbc")):
                break
            time.sleep(0.1)
    assert list(tmp_path.glob("__pycache__/*.nbc"))
