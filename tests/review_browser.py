"""The review's page in a real Chromium, without a graphics card."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Error, Page, Playwright, sync_playwright

from tests.patience import patience

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# The sandbox needs user namespaces, which containers often lack; only the review's own page is opened.
_ARGUMENTS = ["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"]


@contextmanager
def chromium() -> Iterator[Browser]:
    """Yield a browser, or skip the calling test and give the reason."""
    with sync_playwright() as playwright:
        browser = _launched(playwright)
        try:
            yield browser
        finally:
            browser.close()


def _launched(playwright: Playwright) -> Browser:
    own = Path(playwright.chromium.executable_path)
    found = [str(own)] if own.exists() else []
    found += [path for name in _NAMES if (path := shutil.which(name))]
    if not found:
        pytest.skip(
            "no Chromium: install the system's, or run `playwright install chromium`, which needs no root"
        )
    # Through a proxy 127.0.0.1 would be another machine.
    plain = {k: v for k, v in os.environ.items() if "proxy" not in k.lower()}
    try:
        return playwright.chromium.launch(executable_path=found[0], args=_ARGUMENTS, env=plain)
    except Error as error:
        pytest.skip(f"Chromium at {found[0]} does not start: {error.message.splitlines()[0]}")


@dataclass
class Tab:
    """A page of the review, and the errors that occurred in it."""

    page: Page
    origin: str
    faults: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.set_default_timeout(patience(15_000))
        self.page.on("pageerror", lambda e: self.faults.append(f"error: {e}"))
        self.page.on("dialog", lambda d: (self.faults.append(f"dialog: {d.message}"), d.dismiss()))
        self.page.on("request", self._asked)
        self.page.on("console", lambda m: "Content Security Policy" in m.text and self.faults.append(m.text))

    def _asked(self, request: Any) -> None:
        blobs = "blob:null/" if self.origin == "file://" else f"blob:{self.origin}/"
        if not request.url.startswith((self.origin + "/", "data:", blobs)):
            self.faults.append(f"asked {request.url}")

    def open(self, address: str, model: bool = False) -> None:
        self.page.goto(address)
        self.page.wait_for_selector(".list .row")
        if model:
            self.page.wait_for_selector(".veil", state="detached", timeout=patience(60_000))

    def js(self, expression: str) -> Any:
        return self.page.evaluate(expression)

    def until(self, expression: str, seconds: float = 15) -> Any:
        """Wait until an expression is true; the page's content policy forbids the way of Playwright."""
        end = time.monotonic() + patience(seconds)
        while time.monotonic() < end:
            if found := self.js(expression):
                return found
            time.sleep(0.05)
        raise AssertionError(
            f"never true: {expression}; notice: {self.page.locator('.notice').inner_text()!r}"
        )

    def named(self, who: str) -> None:
        self.page.fill("#who", who)
        self.page.locator("#who").press("Tab")
        self.focus_list()

    def focus_list(self) -> None:
        self.page.locator(".list .row[aria-current=true], .list .row").first.focus()

    @property
    def revision(self) -> int:
        return int(self.js("boresight.session.state.revision"))

    @contextmanager
    def one_change(self) -> Iterator[None]:
        """Perform one action within this context, and wait until the server has accepted it."""
        before = self.revision
        yield
        self.until(f"boresight.session.state.revision === {before + 1} && boresight.session.seal !== null")

    def keys(self, *names: str) -> None:
        for name in names:
            self.page.keyboard.press(name)

    def finding(self, name: str) -> dict[str, Any]:
        found: dict[str, Any] = self.js(f"boresight.session.state.findings.find((f) => f.id === {name!r})")
        return found

    def standing(self) -> list[str]:
        found: list[str] = self.js("boresight.session.standing.map((f) => f.id)")
        return found

    def choose(self, name: str) -> None:
        self.js(f"boresight.session.select({name!r})")
        self.focus_list()

    def click_wall(self, *places: tuple[float, float]) -> None:
        """Click the unrolled wall at distances, mm, and azimuths, rad."""
        for distance, azimuth in places:
            x, y = self.js(f"[boresight.flat.x({distance}), boresight.flat.y({azimuth})]")
            self.page.locator(".flat canvas").click(position={"x": x, "y": y})

    def show_wall(self, distance: float, azimuth: float, mm_per_px: float) -> None:
        """Bring a part of the unrolled wall into view."""
        self.js(
            f"(boresight.flat.view = {{distance: {distance}, azimuth: {azimuth}, mmPerPx: {mm_per_px}}},"
            " boresight.flat.paint())"
        )

    def status(self) -> str:
        """Return the text shown below the unrolled wall."""
        return str(self.page.locator("#view-flat .status").inner_text())

    def page_of(self, name: str) -> None:
        self.page.click(f'[data-page="{name}"]')


@contextmanager
def tab(context: BrowserContext, origin: str) -> Iterator[Tab]:
    """Yield a new tab; when it is closed, no error may have occurred in it."""
    made = Tab(context.new_page(), origin)
    try:
        yield made
        assert made.faults == []
    finally:
        made.page.close()
