"""Accessibility of the page: axe finds no serious fault in any of its states, in light and dark mode."""

from __future__ import annotations

from importlib.resources import files

import pytest

from tests.review_browser import Tab, tab

AXE = files("axe_playwright_python").joinpath("axe.min.js").read_text("utf-8")
SERIOUS = ("serious", "critical")


def faults(page: Tab, where: str) -> list[str]:
    """Return the serious faults that axe finds in what the page shows now."""
    if not page.js("!!window.axe"):
        page.js(AXE)
    found = page.js("axe.run(document, {resultTypes: ['violations']})")["violations"]
    return [
        f"{where}: {v['id']}: {node['html'][:120]}"
        for v in found
        if v["impact"] in SERIOUS
        for node in v["nodes"]
    ]


@pytest.fixture(params=["light", "dark"])
def coloured(page: Tab, request: pytest.FixtureRequest):
    page.page.emulate_media(color_scheme=request.param)
    yield page
    page.page.emulate_media(color_scheme="light")


def test_axe_finds_no_serious_fault(coloured: Tab) -> None:
    page, found = coloured, []
    for name in page.js("[...document.querySelectorAll('[data-page]')].map((b) => b.dataset.page)"):
        page.page_of(name)
        found += faults(page, name)
    page.page_of("Inspect")
    page.choose(page.standing()[0])
    page.keys("r")
    found += faults(page, "asking for a reason")
    page.keys("Escape")
    page.js("boresight.session.take('redraw')")
    found += faults(page, "redrawing")
    page.js("boresight.session.take('none')")
    page.js("boresight.session.show('deviation')")
    page.page.click("#view-model .legend >> text=Set limits")
    found += faults(page, "limits of colours")
    page.page.click("#view-model .legend >> text=Cancel")
    page.js("boresight.session.show('photo')")
    page.keys("?")
    found += faults(page, "keys")
    page.keys("Escape")
    assert not found, "\n".join(found)


def test_axe_reports_a_planted_fault(page: Tab) -> None:
    """Control: axe reports a picture without alternative text."""
    page.js("document.body.append(Object.assign(new Image(), {id: 'mute'}))")
    assert faults(page, "control")
    page.js("document.querySelector('#mute').remove()")


def test_axe_finds_no_serious_fault_in_the_reports(context, server, run, tmp_path) -> None:
    reviewed = tmp_path / "reviewed.html"
    reviewed.write_bytes(server.ask("/api/papers/report.html").body)
    with tab(context, "file://") as page:
        for report in (run / "report.html", reviewed):
            page.page.goto(report.as_uri())
            assert not faults(page, str(report))
