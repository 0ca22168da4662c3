"""Shipped files are found by name.

An existing file has priority, and for a wrong name the choices are listed.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.files.installed import PARAMETERS, PRIORS, SCENES, file_or_shipped, shipped_names
from pipeline.simulator.prior import read_prior
from pipeline.simulator.scene import read_scene
from tests.shared_data import PROJECT_ROOT


def test_every_shipped_scene_and_prior_is_found_by_its_name_and_read() -> None:
    for name in shipped_names(SCENES):
        read_scene(file_or_shipped(Path(name), SCENES))
    for name in shipped_names(PRIORS):
        read_prior(file_or_shipped(Path(name), PRIORS))
    assert {"straight-4-inch", "gauge-4-inch"} <= set(shipped_names(SCENES))
    assert {"pairs", "small"} <= set(shipped_names(PRIORS))


def test_the_shipped_files_are_those_of_configs() -> None:
    found = file_or_shipped(Path("long"), PARAMETERS)
    assert found.resolve() == PROJECT_ROOT / "configs" / "long.yaml"


def test_an_existing_file_has_priority(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("pairs").write_text("mine", "utf-8")
    assert file_or_shipped(Path("pairs"), PRIORS) == Path("pairs")


@pytest.mark.parametrize("given", ["pairs.yaml", "./priors/pairs", "configs/priors/pairs.yaml"])
def test_a_path_is_not_changed(given: str) -> None:
    assert file_or_shipped(Path(given), PRIORS) == Path(given)


def test_for_a_name_that_is_not_shipped_the_error_lists_the_shipped_ones() -> None:
    with pytest.raises(InputError, match=r"one of: pairs, small"):
        file_or_shipped(Path("straight-4-inch"), PRIORS)
