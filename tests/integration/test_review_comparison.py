"""A run compared with an earlier one by the program: the page's data, the export, refused inputs."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipeline.artefacts.comparison import Fate
from pipeline.cli import app
from pipeline.commands.staged_comparison import StagedComparison
from pipeline.review.compared import DIFFERENCE, Compared, run_pair
from pipeline.review.review import open_review
from pipeline.review.run_files import RunFiles


@pytest.fixture(scope="module")
def compared(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Compared:
    """The sample's run compared with itself: they coincide, and nothing may have changed."""
    earlier = tmp_path_factory.mktemp("earlier") / "earlier"
    shutil.copytree(sample, earlier)
    later = earlier.with_name("later")
    shutil.copytree(sample, later)
    pair = run_pair(open_review(RunFiles(later)), RunFiles(earlier))
    return Compared(pair, StagedComparison.configured(None, ()), years=2.0)


def test_a_run_compared_with_itself_shows_no_change(compared: Compared) -> None:
    found = compared.document()
    assert abs(found["registration"]["shift_mm"][0]) < 0.1
    assert found["registration"]["agreeing"] == found["registration"]["blocks"]
    assert found["changes"]
    assert {c["fate"] for c in found["changes"]} <= {Fate.UNCHANGED.value, Fate.WELD.value}
    assert not any(c["significant"] for c in found["changes"])


def test_all_tables_hold_the_same_numbers(compared: Compared) -> None:
    rows = list(csv.DictReader(io.StringIO(compared.table("growth.csv")[1].decode("utf-8-sig"))))
    told = json.loads(compared.table("growth.json")[1])
    assert len(rows) == len(told["changes"]) == len(compared.document()["changes"])
    for row, change in zip(rows, told["changes"], strict=True):
        for name in ("depth_growth_mm", "depth_growth_sigma_mm", "depth_rate_mm_per_year", "p_adjusted"):
            assert row[name] == ("" if change[name] is None else str(change[name]))
        if change["depth_growth_mm"] is not None:
            rate = change["depth_growth_sigma_mm"] / 2
            assert change["depth_rate_sigma_mm_per_year"] == pytest.approx(rate, abs=1e-3)


def test_a_second_opening_computes_nothing(compared: Compared) -> None:
    pair = compared.pair
    kept = pair.now.files.path / "review" / "comparison" / ".boresight"

    def written() -> dict[str, int]:
        return {str(f): f.stat().st_mtime_ns for f in kept.rglob("manifest.json")}

    first, before = compared.document(), written()
    assert len(before) == 2
    again = Compared(run_pair(pair.now, pair.earlier.files), StagedComparison.configured(None, ()), 2.0)
    assert again.document() == first
    assert written() == before
    stricter = StagedComparison.configured(None, ("register.least_share=0.5",))
    assert Compared(pair, stricter, 2.0).document() == first
    assert len(written()) == 4, "another parameter is another result"


def test_every_layer_is_in_the_page_and_in_the_exported_copy(compared: Compared, tmp_path: Path) -> None:
    later = compared.pair.now.files.path
    earlier = compared.pair.earlier.files.path
    command = ["review", str(later), "--compare", str(earlier), "--export", str(tmp_path / "copy")]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert "pieces of wall agree" in done.output
    for name in (*DIFFERENCE, "earlier-photo", "earlier-deviation"):
        assert (tmp_path / "copy" / "tiles" / name / "0" / "0" / "0.png").is_file()
    data = (tmp_path / "copy" / "assets" / "data.js").read_text("utf-8")
    assert json.loads(re.sub(r"^window\.BORESIGHT=|;\s*$", "", data))["comparison"]["earlier"]
    assert (tmp_path / "copy" / "growth.csv").is_file()


def test_years_without_an_earlier_run_are_refused(sample: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(sample, run)
    done = CliRunner().invoke(app, ["review", str(run), "--years", "2", "--no-browser"])
    assert done.exit_code != 0
