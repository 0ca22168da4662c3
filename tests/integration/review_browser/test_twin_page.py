"""The twin's page as a tab of the review: it is shown, its controls work, and it cannot query the server."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from pipeline.api.diagnosis.simulated import DiagnosisTried
from pipeline.api.twin import TwinOf, write_twin
from pipeline.artefacts.twin import Mismatch, NamedFigure, RegionFit, Twin, TwinView
from pipeline.cli import app
from pipeline.errors import InputError
from pipeline.files.provenance import MadeBy
from tests.review_browser import Tab, tab
from tests.review_server import ReviewServer


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("twin")
    picture = np.tile(np.arange(40, dtype=np.uint8) * 4, (30, 1))
    bloom = Mismatch("bloom", "intensity", "image", (), (), 0.5, 1.0, 1.1, "It looks like bloom.")
    found = Twin(
        np.array([4]), True, (NamedFigure("white_dn", 255.0, 0.0),), (), (RegionFit("wall", 9, 1.2, 1.1),),
        (), 45.0, 50.0, 1.1, 0.0, 0.9, 0.97, (), (TwinView(4, "led", 1.2, picture, picture, picture),),
        withdrawn=(bloom,),
    )  # fmt: skip
    write_twin(found, DiagnosisTried(), TwinOf("/runs/one"), MadeBy("twin", {}, {}), folder)
    return folder


@pytest.fixture(scope="module")
def server(run: Path, twin: Path):
    with ReviewServer(run, words=("--twin", str(twin))) as started:
        yield started


def test_the_twin_has_a_tab_in_which_the_slider_works(shared_tab: Tab) -> None:
    shared_tab.page_of("Twin")
    frame = shared_tab.page.frame_locator("iframe[title=twin]")
    assert frame.locator("#shown").inner_text() == "re-rendered"
    frame.locator("#slide").fill("200")
    assert frame.locator("#shown").inner_text() == "z"
    assert "It looks like bloom." in frame.locator("body").inner_text()
    assert not shared_tab.faults


def test_the_twins_page_cannot_query_the_server(shared_tab: Tab, server: ReviewServer) -> None:
    shared_tab.page_of("Twin")
    inside = next(f for f in shared_tab.page.frames if f.url.endswith("/twin"))
    asked = inside.evaluate("fetch('/api/state').then(() => 'answered', () => 'refused')")
    assert asked == "refused"
    assert inside.evaluate("origin") == "null"
    shared_tab.faults.clear()  # the browser reports the refused request
    policy = server.ask("/twin").headers["content-security-policy"]
    assert "sandbox allow-scripts" in policy
    assert "connect-src" not in policy
    assert server.ask("/twin", cookie="").code == 403


def test_without_a_twin_the_tab_says_how_to_make_one(run: Path, context) -> None:
    with ReviewServer(run) as plain, tab(context, plain.origin) as opened:
        opened.open(plain.address)
        opened.page_of("Twin")
        assert "boresight twin RUN -o DIR" in opened.page.locator("#twin").inner_text()
        assert plain.ask("/twin").code != 200


def test_a_read_only_copy_holds_the_twin(run: Path, twin: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    asked = CliRunner().invoke(app, ["review", str(run), "--export", str(copy), "--twin", str(twin)])
    assert asked.exit_code == 0, asked.output
    assert (copy / "twin.html").read_bytes() == (twin / "twin.html").read_bytes()
    assert '"twin":true' in (copy / "assets" / "data.js").read_text("utf-8")


def test_a_folder_without_a_twin_is_refused_with_its_name(run: Path, tmp_path: Path) -> None:
    asked = CliRunner().invoke(app, ["review", str(run), "--no-browser", "--twin", str(tmp_path)])
    assert isinstance(asked.exception, InputError)
    assert "twin.html" in str(asked.exception)
