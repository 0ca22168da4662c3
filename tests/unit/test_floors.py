"""The rooms of the program are arranged in floors.

Imports lead downwards, and private names stay in their module.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.floors import (
    FLOORS,
    IMPORTS_STILL_THERE,
    PRIVATE_STILL_THERE,
    against_the_floors,
    imports_below,
    private_names,
)

ROOT = Path(__file__).resolve().parents[2]


def program(folder: Path, **texts: str) -> Path:
    """Write modules, named with two underscores for each dot, with all the packages that contain them."""
    for name, text in texts.items():
        file = folder.joinpath(*name.split("__")).with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        for package in file.parents[: len(file.relative_to(folder).parts) - 1]:
            (package / "__init__.py").touch()
        file.write_text(text, "utf-8")
    return folder


def test_imports_lead_downwards() -> None:
    assert against_the_floors(imports_below(ROOT), IMPORTS_STILL_THERE) == []


def test_the_architecture_page_shows_the_same_floors() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    rows = [f"| {name} | {', '.join(f'`{room}`' for room in rooms)} |" for name, rooms in FLOORS]
    assert "\n".join(rows) in text, "bring the table of ARCHITECTURE.md in line with FLOORS"


def test_the_architecture_page_names_existing_files() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    rows = [row for row in text.partition("## Where is")[2].splitlines() if row.startswith("| ")]
    assert len(rows) > 30
    assert [name for row in rows for name in absent(row)] == []
    assert absent("| x | `pipeline/errors.py`, `gone.py`; `pipeline/gone/` |") == [
        "gone.py",
        "pipeline/gone/",
    ]


def absent(row: str) -> list[str]:
    """Return the files of a row that do not exist; a bare name lies beside or below the one before it."""
    out, before = [], ROOT
    for name in re.findall(r"`([\w/]+(?:\.py|\.ts|/))`", row):
        places = [folder / name for folder in (ROOT, before, before.parent)]
        found = next((place for place in places if place.exists()), None)
        out += [name] if found is None else []
        before = before if found is None else found
    return out


def test_private_names_are_used_only_in_their_module() -> None:
    assert private_names(imports_below(ROOT), PRIVATE_STILL_THERE) == []


@pytest.mark.parametrize(
    ("module", "text", "told"),
    [
        ("pipeline__machine__plan", "from stages.rings import RINGS", "line 1: imports stages.rings"),
        ("pipeline__export__glb", "import stages.mesh.mesh", "imports stages.mesh.mesh"),
        (
            "pipeline__geometry__axis",
            "\nfrom pipeline.artefacts import measured",
            "line 2: imports",
        ),
        (
            "pipeline__files__disk",
            "def f():\n    import pipeline.machine.store",
            "line 2: imports",
        ),
        ("pipeline__machine__plan", "import pipeline.simulator.scene", "imports pipeline.simulator.scene"),
        ("pipeline__machine__plan", "import pipeline.review.review", "imports pipeline.review.review"),
        ("stages__rings__search", "from stages.texture import wall", "imports stages.texture"),
        ("pipeline__system__threads", "from pipeline.files.disk import a", "imports pipeline.files.disk"),
        (
            "pipeline__attic__old",
            "from pipeline.errors import InputError",
            "this room has no floor",
        ),
    ],
)
def test_an_import_upwards_is_reported(tmp_path: Path, module: str, text: str, told: str) -> None:
    (line,) = against_the_floors(imports_below(program(tmp_path, **{module: text})), {})
    assert told in line


def test_an_import_downwards_is_not_reported(tmp_path: Path) -> None:
    texts = {
        "pipeline__api__job": "import stages.rings\nfrom pipeline.machine.plan import Plan",
        "pipeline__machine__plan": "from pipeline.machine import store\nimport numpy, ast",
        "pipeline__machine__store": "",
    }
    assert against_the_floors(imports_below(program(tmp_path, **texts)), {}) == []


def test_an_exception_that_is_no_longer_needed_is_reported(tmp_path: Path) -> None:
    allowed = {("pipeline.files.disk", "pipeline.review.report"): "until it is moved"}
    folder = program(tmp_path, pipeline__files__disk="import pipeline.review.report")
    assert against_the_floors(imports_below(folder), allowed) == []
    (line,) = against_the_floors(imports_below(program(tmp_path, pipeline__files__disk="")), allowed)
    assert "remove this line" in line


@pytest.mark.parametrize(
    "text",
    [
        "from pipeline.machine.store import _secret",
        "from pipeline.machine import store\nstore._secret()",
        "from pipeline.machine import store as kept\nkept._secret()",
        "import pipeline.machine.store\npipeline.machine.store._secret()",
        "from pipeline.machine._store import open_secret",
    ],
)
def test_a_private_name_of_another_module_is_reported(tmp_path: Path, text: str) -> None:
    folder = program(tmp_path, pipeline__machine__plan=text, pipeline__machine__store="_secret = 1")
    assert len(private_names(imports_below(folder), {})) == 1


def test_private_names_of_the_same_module_are_not_reported(tmp_path: Path) -> None:
    text = "import numpy as np\nnp._NoValue\ndef f(self):\n    return self._secret + np.__version__"
    assert private_names(imports_below(program(tmp_path, pipeline__machine__plan=text)), {}) == []
