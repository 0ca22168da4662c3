"""A whole review by keyboard alone, from the first view to the signed report, in Chromium and Firefox."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import pytest

from tests.firefox import firefox
from tests.review_browser import Tab, tab
from tests.review_server import ReviewServer
from tests.reviewed import pdf_text

SIZES = [(1280, 720), (1920, 1080)]
_MOST_TABS = 120


class Hands(Protocol):
    """What the test needs of a browser: pressing keys, and reading what the page shows."""

    def keys(self, *names: str) -> None: ...

    def js(self, expression: str) -> object: ...

    def until(self, expression: str, seconds: float = ...) -> object: ...


@pytest.fixture
def server(sample: Path, tmp_path: Path) -> Iterator[ReviewServer]:
    """A server for this test alone: its decisions and signature are not undone."""
    shutil.copytree(sample, tmp_path / "run")
    with ReviewServer(tmp_path / "run") as started:
        yield started


def tab_to(hands: Hands, place: str) -> None:
    """Press Tab until a certain element has the focus.

    One that cannot be reached is useless without a mouse.
    """
    for _ in range(_MOST_TABS):
        if hands.js(f"!!document.activeElement?.matches({json.dumps(place)})"):
            return
        hands.keys("Tab")
    raise AssertionError(f"{place} is not reached by Tab")


def write(hands: Hands, place: str, text: str) -> None:
    tab_to(hands, place)
    hands.keys(*("Space" if c == " " else c for c in text))


def settled(hands: Hands, condition: str = "true") -> None:
    """Wait until the server has accepted the last action."""
    hands.until(f"boresight.session.seal !== null && ({condition})")


def sitting(hands: Hands) -> None:
    """Decide on every finding, add a missed one, enter the facts of the inspection, and sign."""
    hands.until("!!window.boresight && document.querySelectorAll('.list .row').length > 0")
    # Firefox draws no 3D on machines without OpenGL; everything else must work nevertheless.
    no_3d = "document.querySelector('.veil')?.textContent.includes('no 3D')"
    hands.until(f"boresight.model.isReady || {no_3d}", 60)
    hands.until("[...document.querySelectorAll('.shots img')].some((i) => i.naturalWidth > 0)")
    write(hands, "#who", "Ada Lovelace")
    tab_to(hands, ".list .row[aria-current=true]")
    status = "(k) => boresight.session.standing.filter((f) => f.status === k).length"
    hands.keys("a")
    settled(hands, f"({status})('accepted') === 1")
    hands.keys("r", *"reflection", "Enter")
    settled(hands, f"({status})('rejected') === 1")
    hands.keys("a")
    settled(hands, f"({status})('open') === 0")
    hands.keys("c", *"seen", "Space", *"twice", "Enter")
    settled(hands, "boresight.session.standing.some((f) => f.remarks.length === 1)")
    hands.keys("f", "Shift+ArrowRight", "d", "Enter", *2 * ("Shift+ArrowRight",), "Enter")
    hands.keys(*2 * ("Shift+ArrowDown",), "Enter")
    hands.until("boresight.session.drawn.length === 3")
    tab_to(hands, "select[aria-label='kind of the missed defect']")
    hands.keys("g", "Tab", "Control+Enter")  # gouge, done
    settled(hands, "boresight.session.standing.some((f) => f.kind === 'gouge' && f.status === 'accepted')")
    hands.keys("3")
    write(hands, "#fact-client", "Water Works")
    hands.keys("Enter")
    settled(hands, "boresight.session.state.described.client === 'Water Works'")
    write(hands, "#wall", "6")
    hands.keys("Enter")
    settled(hands, "boresight.session.state.assumed.wall_thickness_mm === 6")
    write(hands, "#sign-standard", "POF")
    hands.keys("Enter")
    hands.until("boresight.session.seal?.signed === true")
    tab_to(hands, ".papers a[href$='report.pdf']")


def assert_signed(server: ReviewServer) -> None:
    text = pdf_text(server.ask("/api/papers/report.pdf").body)
    for words in ("Signed by Ada Lovelace", "standard applied: POF", "Client Water Works", "seen twice"):
        assert words in text
    assert "Findings accepted 3" in text
    assert "Findings rejected 1" in text


@contextmanager
def chromium_tab(browser: object, server: ReviewServer, size: tuple[int, int]) -> Iterator[Tab]:
    context = browser.new_context(viewport={"width": size[0], "height": size[1]})  # type: ignore[attr-defined]
    with tab(context, server.origin) as page:
        page.page.goto(server.address)
        yield page
    context.close()


@pytest.mark.parametrize("size", SIZES)
def test_in_chromium(browser, server: ReviewServer, size: tuple[int, int]) -> None:
    with chromium_tab(browser, server, size) as page:
        sitting(page)
        assert page.page.locator(".badge").inner_text() == "signed"
    assert_signed(server)


@pytest.mark.parametrize("size", SIZES)
def test_in_firefox(server: ReviewServer, tmp_path: Path, size: tuple[int, int]) -> None:
    profile = tmp_path / "profile"
    profile.mkdir()
    with firefox(profile) as page:
        page.ask("WebDriver:SetWindowRect", width=size[0], height=size[1])
        page.ask("WebDriver:Navigate", url=server.address)
        sitting(page)
        assert page.js("document.querySelector('.badge').textContent") == "signed"
    assert_signed(server)
