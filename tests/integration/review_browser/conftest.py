"""Browser, server and tab shared by the tests of one file."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.review_browser import Tab, chromium, tab
from tests.review_server import ReviewServer


@pytest.fixture(scope="package")
def browser():
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def run(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reviewed") / "run"
    shutil.copytree(sample, folder)
    return folder


@pytest.fixture(scope="module")
def server(run: Path):
    with ReviewServer(run) as started:
        yield started


@pytest.fixture(scope="module")
def context(browser):
    made = browser.new_context(viewport={"width": 1280, "height": 720})
    yield made
    made.close()


@pytest.fixture(scope="module")
def shared_tab(context, server: ReviewServer):
    with tab(context, server.origin) as opened:
        opened.open(server.address, model=True)
        opened.named("Ada")
        yield opened


@pytest.fixture
def page(shared_tab: Tab, server: ReviewServer):
    """The shared tab, on its first page; everything done in it is undone afterwards."""
    shared_tab.page_of("Inspect")
    shared_tab.js("boresight.session.take('none')")
    shared_tab.focus_list()
    yield shared_tab
    state = server.ask("/api/state").json()
    while state["may_undo"]:
        state = server.act(state["revision"], do="undo").json()
    shared_tab.js("boresight.session.refresh()")
    shared_tab.until(f"boresight.session.state.revision === {state['revision']}")
