"""`boresight error-budget`: table, JSON, chart and page."""

import json
import re

import pytest
import typer
from typer.testing import CliRunner

from pipeline.commands.error_budget import error_budget
from tests.shared_data import shared


def run(*arguments: str):
    app = typer.Typer()
    app.command()(error_budget)
    return CliRunner().invoke(app, list(arguments))


def test_json_has_rows_sums_and_the_answers_to_the_designers_questions():
    document = json.loads(run("--json", "--draws", "0").stdout)
    table_one = {r["table_one"] for r in document["rows"]} - {""}
    assert table_one == {
        "misalignment", "opening angle", "baseline", "focal length", "camera calibration", "line width",
        "image noise",
    }  # fmt: skip
    assert sum(r["share"] for r in document["rows"]) == pytest.approx(1.0)
    assert document["dominant"] == document["rows"][0]["name"]
    assert [t["accuracy_mm"] for t in document["tolerances"]] == [0.1, 0.02]
    assert len(document["best_baseline"]["each_mm"]) == 3
    parts = (document["total"][k]["known"]["rms_mm"] ** 2 for k in ("systematic", "random"))
    assert sum(parts) == pytest.approx(document["total"]["all"]["known"]["rms_mm"] ** 2)


def test_two_calls_write_the_same_files_which_need_no_others(tmp_path):
    probe = shared("recordings", "open-1-field", "probe.yaml")
    for name in ("a", "b"):
        result = run(str(probe), "--draws", "128", "-o", str(tmp_path / name))
        assert result.exit_code == 0, result.output
    names = {p.name for p in (tmp_path / "a").iterdir()}
    assert names == {"budget.json", "budget.png", "budget.svg", "budget.html"}
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    page = (tmp_path / "a" / "budget.html").read_text("utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!#|data:)|https?://|@import""", page)
    document = json.loads((tmp_path / "a" / "budget.json").read_text("utf-8"))
    for row in document["rows"]:
        assert row["known"]["monte_carlo_rms_mm"] == pytest.approx(row["known"]["rms_mm"], rel=0.02, abs=1e-9)
    total = document["total"]["all"]["known"]
    assert total["monte_carlo_rms_mm"] == pytest.approx(total["rms_mm"], rel=0.02)


def test_a_stated_sigma_is_used():
    document = json.loads(run("--json", "--draws", "0", "--sigma", "laser_tilt=0.5").stdout)
    assert document["dominant"] == "laser_tilt"
    assert document["rows"][0]["origin"] == "given"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--diameter-mm", "-3"), "diameter_mm"),
        (("--sigma", "laser_tlt=1"), "laser_tlt"),
        (("--sigma", "laser_tilt"), "NAME=NUMBER"),
        (("--accuracy-mm", "0"), "accuracy_mm"),
        (("--offset-x-mm", "60"), "outside the pipe"),
    ],
)
def test_bad_input_is_named_in_the_error(arguments, named):
    result = run("--json", "--draws", "0", *arguments)
    assert result.exit_code != 0
    assert named in str(result.exception)
