"""The command line reports refusals as text with an exit code each, and shows help without slow imports."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline.cli import _ATTACHED, _exit_code, main
from pipeline.errors import BoresightError, Cancelled, InputError, UnusableError
from pipeline.files.installed import program_version
from pipeline.machine.runner import FailedError
from stages.catalogue import PIPELINE
from tests.shared_data import PROJECT_ROOT

SAMPLE = PROJECT_ROOT / "data" / "sample"


@dataclass(frozen=True)
class Told:
    code: int
    out: str
    err: str


@pytest.fixture
def boresight(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Told]:
    """Return a function that runs the command line in this process."""

    def call(*arguments: str | Path) -> Told:
        monkeypatch.chdir(PROJECT_ROOT)
        monkeypatch.setattr(sys, "argv", ["boresight", *map(str, arguments)])
        with pytest.raises(SystemExit) as ending:
            main()
        told = capsys.readouterr()
        return Told(int(ending.value.code or 0), told.out, told.err)

    return call


def test_help_names_every_command_and_loads_no_heavy_library() -> None:
    code = (
        "import sys; sys.argv = ['boresight', '--help']\n"
        "from pipeline.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'cv2', 'av', 'numba', 'zarr', 'open3d', 'matplotlib'}\n"
        "print('loaded', sorted(heavy & set(sys.modules)))"
    )
    told = subprocess.run([sys.executable, "-c", code], cwd=PROJECT_ROOT, capture_output=True, text=True)
    assert "loaded []" in told.stdout
    for name in ("run", "stages", "config", *(a.name for a in _ATTACHED)):
        assert f" {name} " in told.stdout


@pytest.mark.parametrize("name", [a.name for a in _ATTACHED])
def test_commands_of_other_modules_are_listed(boresight: Callable[..., Told], name: str) -> None:
    told = boresight(name, "--help")
    assert told.code == 0, told.err
    assert f"boresight {name}" in told.out


def test_help_groups_the_commands_by_purpose(boresight: Callable[..., Told]) -> None:
    told = boresight("--help").out
    places = [
        told.index(f"─ {group} ─")
        for group in dict.fromkeys(("Inspect a pipe", *(a.group for a in _ATTACHED)))
    ]
    assert places == sorted(places)
    assert len(places) == 4
    for attached in _ATTACHED:
        group = told.rindex("╭", 0, told.index(f"│ {attached.name} "))
        assert f"─ {attached.group} ─" in told[group : group + 60], attached.name


def test_the_version_is_printed(boresight: Callable[..., Told]) -> None:
    assert boresight("--version").out == f"boresight {program_version()}\n"


@pytest.mark.parametrize("asked", ["--version", "--help"])
def test_version_and_help_load_no_computing_libraries(asked: str) -> None:
    script = (
        "import atexit, sys; from pipeline.cli import main; "
        "atexit.register(lambda: print('loaded', [m for m in ('numpy', 'pydantic') if m in sys.modules])); "
        "main()"
    )
    told = subprocess.run([sys.executable, "-c", script, asked], capture_output=True, text=True, check=True)
    assert told.stdout.splitlines()[-1] == "loaded []"


@pytest.mark.parametrize(
    ("typed", "offered"), [("rev", "review"), ("calibrate-", "calibrate-laser"), ("review --", "--compare")]
)
def test_the_shell_completes_commands_and_their_options(typed: str, offered: str) -> None:
    asked = {
        "_BORESIGHT_COMPLETE": "complete_bash", "COMP_WORDS": f"boresight {typed}",
        "COMP_CWORD": str(len(typed.split())),
    }  # fmt: skip
    told = subprocess.run(
        [sys.executable, "-m", "pipeline.cli"], cwd=PROJECT_ROOT, capture_output=True, text=True,
        env=os.environ | asked,
    )  # fmt: skip
    assert offered in told.stdout.split(), told


def test_a_command_says_at_once_that_it_starts(
    boresight: Callable[..., Told], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "is starting" not in boresight("verify", "--help").err, "but not into a pipe or a log"
    monkeypatch.setattr("pipeline.cli.sys.stderr.isatty", lambda: True)
    assert boresight("verify", "--help").err.startswith("boresight verify is starting")


def test_stages_are_listed_in_order(boresight: Callable[..., Told]) -> None:
    lines = [line for line in boresight("stages").out.splitlines() if not line.startswith(" ")]
    assert [line.split()[0] for line in lines] == [s.name for s in PIPELINE]


def test_the_default_configuration_is_printed(boresight: Callable[..., Told]) -> None:
    text = (PROJECT_ROOT / "configs" / "default.yaml").read_text("utf-8")
    assert boresight("config", "--default").out == text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "nowhere", "-o", "out"], "nowhere: does not exist"),
        (["run", SAMPLE, "-o", SAMPLE], "do not belong to a boresight run"),
        (["run", SAMPLE, "-o", "out", "--set", "rings.nonsense=1"], "unknown key"),
        (["run", SAMPLE, "-o", "out", "--only", "nonsense"], "no stage nonsense"),
        (["run", SAMPLE, "-o", "out", "--probe", "no.yaml"], r"no.yaml"),
        (["run", SAMPLE, "-o", "/proc/out"], "cannot be written"),
        (["config", "--set", "nonsense"], "is not an assignment"),
    ],
)
def test_refusals_are_text_and_exit_code_2(
    boresight: Callable[..., Told], arguments: list[str | Path], message: str
) -> None:
    told = boresight(*arguments)
    assert told.code == 2
    assert message in told.err
    assert "Traceback" not in told.err
    assert not (PROJECT_ROOT / "out").exists()


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (FailedError("x"), 1),
        (InputError("f", "x"), 2),
        (BoresightError("x"), 2),
        (UnusableError("s", "x"), 3),
        (Cancelled("x"), 130),
    ],
)
def test_exit_codes(error: BoresightError, code: int) -> None:
    assert _exit_code(error) == code
