"""After a kill at any moment the same command completes the run with the same result, byte for byte."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.shared_data import PROJECT_ROOT

_PAUSED = ("draw.pause_s=0.05", "draw.count=1000000")


def start(folder: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", "tests.toys", str(folder), *_PAUSED], cwd=PROJECT_ROOT)


def content(folder: Path) -> dict[str, bytes]:
    """Return the contents of all files except those that contain times."""
    told = ("run.json", "run.log", "lock", "manifest.json")
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and p.name not in told
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, bytes], float]:
    folder = tmp_path_factory.mktemp("undisturbed")
    # The first run also reads all libraries from the disk: a later one shows how long a run takes.
    assert start(folder / "first").wait() == 0
    begin = time.monotonic()
    assert start(folder / "run").wait() == 0
    return content(folder / "run"), time.monotonic() - begin


@pytest.mark.parametrize("seed", range(2))
def test_killed_at_random_moments(
    tmp_path: Path, seed: int, undisturbed: tuple[dict[str, bytes], float]
) -> None:
    expected, seconds = undisturbed
    moments = random.Random(seed)
    kills = 0
    for _ in range(3):
        process = start(tmp_path / "run")
        try:
            process.wait(timeout=moments.uniform(0.1, 0.8) * seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            kills += 1
    assert start(tmp_path / "run").wait() == 0
    assert kills
    assert content(tmp_path / "run") == expected


_KILLED_AT = """
import os, sys
from pathlib import Path
from tests.toys import run_toys

TOUCHES = ("open", "os.rename", "os.mkdir", "os.remove", "os.rmdir", "shutil.rmtree")
root = Path(sys.argv[1])
run_toys(root / "whole")

def killed_before(moment):
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -9
    left = moment
    def count(event, arguments):
        nonlocal left
        if event in TOUCHES and str(root) in str(arguments[0]):
            left -= 1
            if left < 0:
                os.kill(os.getpid(), 9)
    sys.addaudithook(count)
    run_toys(root / str(moment))
    os._exit(0)

moment = 0
while killed_before(moment):
    run_toys(root / str(moment))
    moment += 5
print(moment)
"""


def test_killed_before_every_fifth_file_operation(tmp_path: Path) -> None:
    """Kill the process before its n-th file operation below the run folder, not after a time."""
    told = subprocess.run(
        [sys.executable, "-c", _KILLED_AT, tmp_path], cwd=PROJECT_ROOT, capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr
    last = int(told.stdout)
    assert last > 50
    whole = content(tmp_path / "whole")
    for moment in range(0, last, 5):
        assert content(tmp_path / str(moment)) == whole, f"killed before file operation {moment}"
