"""A key changes with the text of any module that the stage imports, directly or indirectly."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import pytest

from pipeline.machine.plan import source_digest

PACKAGE = {
    "__init__.py": "",
    "stage.py": "import math\nfrom toy_house import (\n    near,\n)\n"
    "\ndef work():\n    from toy_house.sub.far import x\n",
    "near.py": "y = 1\n",
    "stranger.py": "z = 1\n",
    "sub/__init__.py": "",
    "sub/far.py": "import toy_house.near\nx = 1\n",
}


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, text in PACKAGE.items():
        path = tmp_path / "toy_house" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    for name in [m for m in sys.modules if m.startswith("toy_house")]:
        monkeypatch.delitem(sys.modules, name)
    return tmp_path / "toy_house"


@pytest.mark.parametrize(
    ("name", "matters"),
    [(n, n != "stranger.py") for n in PACKAGE],
)
def test_the_text_of_imported_modules_counts_and_no_other(house: Path, name: str, matters: bool) -> None:
    work = import_module("toy_house.stage").work
    before = source_digest(work)
    assert source_digest(work) == before
    with (house / name).open("a") as stream:
        stream.write("# changed\n")
    assert (source_digest(work) != before) == matters


def test_modules_are_read_but_not_executed(house: Path) -> None:
    (house / "sub" / "far.py").write_text("raise RuntimeError('started')\n")
    assert source_digest(import_module("toy_house.stage").work)
