"""An installed wheel works without a checkout of the project: every command, and the example scripts."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.bad_recordings import cut_sample
from tests.shared_data import PROJECT_ROOT

pytestmark = pytest.mark.slow
QUICK = ("--set", "rings.azimuths=360", "--set", "mesh.texel_mm=1.0")


@dataclass(frozen=True)
class Installed:
    """A wheel installed in a separate environment, and a folder to work in."""

    environment: Path
    folder: Path

    def call(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        """Call a program of the environment, from outside the checkout."""
        own = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        program, *arguments = map(str, words)
        command = [str(self.environment / "bin" / program), *arguments]
        return subprocess.run(command, cwd=self.folder, env=own, capture_output=True, text=True)

    def done(self, *words: str | Path) -> str:
        """Call a program that must succeed; return its output."""
        called = self.call(*words)
        assert called.returncode == 0, called.stdout + called.stderr
        return called.stdout + called.stderr


@pytest.fixture(scope="module")
def installed(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The wheel, built from a copy, in an environment that sees the libraries but not the checkout.

    It is installed after the sample's run, which has compiled the inner loops that are copied.
    """
    folder = tmp_path_factory.mktemp("wheel")
    _copy_project(folder / "source")
    environment = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    _pip("wheel", "--no-build-isolation", "--no-deps", "-w", folder / "dist", folder / "source")
    (wheel,) = (folder / "dist").glob("*.whl")
    _pip("--python", environment / "bin" / "python", "install", "--no-deps", "--no-index", wheel)
    packages = next((environment / "lib").glob("python*")) / "site-packages"
    # A .pth file adds a folder, but not the folders that .pth files in it would add: not the checkout.
    (packages / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", "utf-8")
    for package in ("pipeline", "stages"):
        _share_compiled(PROJECT_ROOT / package, packages / package)
    (folder / "work").mkdir()
    return Installed(environment, folder / "work")


@pytest.fixture(scope="module")
def measured(installed: Installed) -> tuple[Path, str]:
    """The run of the sample's first half by the first example, and the output of the example."""
    run, recording = installed.folder / "run", cut_sample(installed.folder / "recording", frames=80)
    example = PROJECT_ROOT / "data" / "examples" / "measure.py"
    return run, installed.done("python", example, recording, run)


def _pip(*words: str | Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *words], check=True
    )


def _copy_project(target: Path) -> None:
    """Copy the sources of a wheel: an old build folder in the checkout must not get into it."""
    unwanted = shutil.ignore_patterns("__pycache__")
    for name in ("pipeline", "stages", "configs"):
        shutil.copytree(PROJECT_ROOT / name, target / name, symlinks=True, ignore=unwanted)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(PROJECT_ROOT / name, target / name)


def _share_compiled(checkout: Path, package: Path) -> None:
    """Give the installed package the inner loops compiled for the checkout, which saves a minute.

    Numba recognises a compiled loop by the time and size of its source file.
    """
    for source in package.rglob("*.py"):
        original = checkout / source.relative_to(package)
        status = original.stat()
        os.utime(source, ns=(status.st_atime_ns, status.st_mtime_ns))
        for compiled in (original.parent / "__pycache__").glob(f"{source.stem}.*.nb?"):
            (source.parent / "__pycache__").mkdir(exist_ok=True)
            shutil.copy(compiled, source.parent / "__pycache__" / compiled.name)


def test_no_module_comes_from_the_checkout(installed: Installed) -> None:
    script = (
        "import boresight, pipeline, stages; print(boresight.__file__, pipeline.__file__, stages.__file__)"
    )
    told = installed.done("python", "-c", script).split()
    assert all(Path(file).is_relative_to(installed.environment) for file in told)


def test_the_first_example_measures_the_sample(measured: tuple[Path, str]) -> None:
    run, told = measured
    assert "mean diameter: 101." in told
    assert "mm deep" in told
    assert (run / "report.html").is_file()


def test_run_finds_that_the_examples_run_is_complete(
    installed: Installed, measured: tuple[Path, str]
) -> None:
    told = installed.done("boresight", "run", installed.folder / "recording", "-o", measured[0], *QUICK)
    assert told.count("reused") == 10


def test_a_run_is_read_as_arrays_and_tables(installed: Installed, measured: tuple[Path, str]) -> None:
    script = (
        "import boresight; run = boresight.open_run('run'); frames = len(run.trajectory.frame);"
        "assert run.rings.radius_px.shape[1] == 360 and run.trajectory.T_pc.shape == (frames, 4, 4);"
        "assert len(run.table('trajectory')) == frames;"
        "assert list(run.table('defects').id) == [d.id for d in run.defects.items];"
        "assert abs(run.table('sections').mean_diameter_mm[3] / run.sections.mean_diameter_mm[3] - 1) < 1e-5;"
        "assert run.recording().name == 'sample' and run.probe().camera.image_size[0] > 100;"
        "assert [f.id for f in run.findings()] == [str(d.id) for d in run.defects.items]"
    )
    installed.done("python", "-c", script)


def test_a_folder_that_is_no_run_is_refused(installed: Installed) -> None:
    called = installed.call("python", "-c", "import boresight; boresight.open_run('.')")
    assert "InputError" in called.stderr
    assert "give the folder of a finished run" in called.stderr


def test_the_second_example_simulates_a_scene_given_by_name(installed: Installed) -> None:
    example = PROJECT_ROOT / "data" / "examples" / "plan.py"
    told = installed.done("python", example, "long-4-inch", "planned", "laser_tilt=0.6@40")
    assert "8 frames" in told
    assert (installed.folder / "planned" / "recording-truth" / "truth.json").is_file()


def test_review_exports_its_page(installed: Installed, measured: tuple[Path, str]) -> None:
    installed.done("boresight", "review", measured[0], "--export", "review")
    assert (installed.folder / "review" / "index.html").is_file()


def test_gallery_draws_an_effect(installed: Installed) -> None:
    installed.done("boresight", "gallery", "-o", "tilt.html", "--with", "laser_tilt=0.6@40")
    assert (installed.folder / "tilt.html").is_file()


def test_prove_draws_from_a_prior_given_by_name(installed: Installed) -> None:
    called = installed.call("boresight", "prove", "-o", "proof", "--prior", "nothing-of-the-kind")
    assert called.returncode == 2
    assert "one of: pairs, small" in called.stderr


def test_every_command_is_there(installed: Installed) -> None:
    script = (
        "from typer.testing import CliRunner; from pipeline.cli import app;"
        "names = [c.name or c.callback.__name__ for c in app.registered_commands]; assert len(names) > 15;"
        "failed = [n for n in names if 'Usage' not in CliRunner().invoke(app, [n, '--help']).output];"
        "assert not failed, failed"
    )
    installed.done("python", "-c", script)


def test_another_package_named_pipeline_is_reported(installed: Installed) -> None:
    other = installed.folder / "other" / "pipeline"
    other.mkdir(parents=True)
    (other / "__init__.py").touch()
    script = f"import sys; sys.path.insert(0, {str(other.parent)!r}); import boresight"
    called = installed.call("python", "-c", script)
    assert "another package named pipeline hides boresight's own" in called.stderr
