"""Kernels give the same bytes whether they were compiled in this process or come from the cache on the disk.

A fast-math function that is not inlined exists twice in the process that compiles it: on its own and within
its caller, each optimised separately. The cache holds the one within the caller.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.shared_data import PROJECT_ROOT

_MATCHED = """
import hashlib
import cv2
import numpy as np
from stages.motion.tracking.patches import cut

random = np.random.default_rng(0)
wall = cv2.GaussianBlur(random.standard_normal((120, 400)).astype(np.float32), (0, 0), 2)
row, column = random.integers(30, 90, 60), random.integers(0, 400, 60)
seen = wall + 0.01 * random.standard_normal(wall.shape).astype(np.float32)
found = cut(wall, row, column, 10).match(seen, np.ones(wall.shape, bool), row + 0.7, column - 1.3)
print(hashlib.sha256(found.offset.tobytes() + found.correlation.tobytes()).hexdigest())
"""


def test_matches_are_the_same_bytes_freshly_compiled_and_from_the_cache(tmp_path: Path) -> None:
    first, second = (_printed(_MATCHED, tmp_path) for _ in range(2))
    assert any(tmp_path.rglob("patches._match*.nbi")), "control: the second time it came from the cache"
    assert len(first) == 64
    assert first == second


def _printed(script: str, cache: Path) -> str:
    """Return the output of a script in a separate process with its kernel cache in a folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(PROJECT_ROOT)}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()
