"""The Compare tab: two runs of one pipe; the later one has a dent where the earlier one had sound wall."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.artefacts.measured import Wall
from pipeline.machine.run_folder import RunFolder
from pipeline.machine.store import Provenance
from pipeline.review.run_files import RunFiles
from tests.patience import patience
from tests.review_browser import Tab, tab
from tests.review_server import ReviewServer

YEARS = 2.0
_PLACES = "boresight.session.cursor"


@pytest.fixture(scope="module")
def earlier(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample's run with sound wall in place of its deepest finding."""
    folder = tmp_path_factory.mktemp("years-ago") / "earlier"
    shutil.copytree(sample, folder)
    files = RunFiles(folder)
    findings = json.loads(files.defects_text())
    healed = max(findings, key=lambda f: abs(f["depth_mm"]))
    rest = [f for f in findings if f is not healed]
    (folder / "defects.json").write_text(json.dumps(rest))
    wall = files.artefact(Wall)
    (stage,) = (s for s in files.record()["stages"] if s["name"] == "accumulate")
    made = Provenance(stage["name"], stage["version"], stage["key"], 0.0, ())
    RunFolder(folder).store.write(_healed(wall, healed), made)
    return folder


def _healed(wall: Wall, finding: dict[str, Any]) -> Wall:
    """Return the wall with a finding replaced by straight lines along the pipe."""
    told, margin_mm = wall.radius_map, 3.0
    radius = told.radius_mm.copy()
    s0, s1 = finding["distance_from_mm"] - margin_mm, finding["distance_to_mm"] + margin_mm
    rows = np.flatnonzero((told.distance_mm >= s0) & (told.distance_mm <= s1))
    around = np.array([a for _, a in finding["outline"]])
    middle = np.angle(np.mean(np.exp(1j * around)))
    off = np.abs(np.angle(np.exp(1j * (told.azimuth_rad - middle))))
    half = np.max(np.abs(np.angle(np.exp(1j * (around - middle))))) + margin_mm / float(np.nanmedian(radius))
    share = np.linspace(0, 1, len(rows))[:, None]
    columns = np.flatnonzero(off <= half)
    first, last = radius[rows[0], columns], radius[rows[-1], columns]
    radius[np.ix_(rows, columns)] = first + share * (last - first)
    return replace(wall, radius_map=replace(told, radius_mm=radius))


@pytest.fixture(scope="module")
def compared(sample: Path, earlier: Path, browser, tmp_path_factory) -> Iterator[tuple[Tab, ReviewServer]]:
    later = tmp_path_factory.mktemp("now") / "later"
    shutil.copytree(sample, later)
    words = ("--compare", str(earlier), "--years", str(YEARS))
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    with ReviewServer(later, words=words) as server, tab(context, server.origin) as opened:
        opened.open(server.address)
        opened.page_of("Compare")
        opened.page.wait_for_selector("#compare table.grid", timeout=patience(60_000))
        yield opened, server
    context.close()


def rows_of(page: Tab) -> list[list[str]]:
    rows = page.page.locator("#compare table.grid tbody tr")
    return [rows.nth(k).locator("td").all_inner_texts() for k in range(rows.count())]


def test_the_table_shows_the_growth_that_the_server_found(compared: tuple[Tab, ReviewServer]) -> None:
    page, server = compared
    told = server.ask("/api/comparison").json()
    rows = rows_of(page)
    assert len(rows) == len(told["changes"]) > 1
    (new,) = (k for k, change in enumerate(told["changes"]) if change["changed"])
    for k, (cells, change) in enumerate(zip(rows, told["changes"], strict=True)):
        assert cells[3] == ("◆ " if k == new else "") + change["fate"]
        assert (change["fate"] in ("new", "grown")) is (k == new)
    growth, rate = rows[new][6], rows[new][-1]
    number, sigma = (told["changes"][new][f"depth_growth{k}_mm"] for k in ("", "_sigma"))
    assert abs(number) > 10 * sigma, "the replaced wall is clearly found as a change"
    assert growth.startswith("+" if number > 0 else "-")
    assert float(growth.split()[0]) == pytest.approx(number, abs=0.006)
    assert float(rate.split()[0].lstrip("+")) == pytest.approx(number / YEARS, abs=0.006)
    text = page.page.locator("#compare").inner_text()
    assert told["statement"] in text
    assert f"{told['registration']['agreeing']} of {told['registration']['blocks']}" in text


def test_both_halves_are_drawn_as_soon_as_the_tab_opens(compared: tuple[Tab, ReviewServer]) -> None:
    page, _ = compared
    spread = """(() => { const c = document.querySelector('#view-compare canvas'), d = c.getContext('2d');
      return [0.1, 0.6].map((at) => {
        const px = d.getImageData(c.width * at, 0, c.width * 0.3, c.height).data;
        const v = []; for (let k = 0; k < px.length; k += 404) v.push(px[k]);
        return Math.max(...v) - Math.min(...v); }); })()"""
    page.until(f"Math.min(...{spread}) > 20")


def test_a_finding_chosen_in_the_table_is_shown_in_every_view(compared: tuple[Tab, ReviewServer]) -> None:
    page, server = compared
    for k, change in enumerate(server.ask("/api/comparison").json()["changes"]):
        page.page.locator("#compare table.grid tbody button").nth(k).click()
        distance, azimuth = page.js(_PLACES)
        assert distance == pytest.approx(change["distance_mm"])
        assert np.exp(1j * azimuth) == pytest.approx(np.exp(1j * change["azimuth_rad"]))
        told = page.page.locator("#view-compare .told").inner_text()
        assert told.startswith(f"{change['distance_mm']:.1f} mm")
        assert f"in {server.ask('/api/comparison').json()['earlier']}: " in told


@pytest.mark.parametrize("way", ["swipe", "beside", "difference", "difference_sigma"])
def test_every_layer_of_the_comparison_paints_another_picture(
    compared: tuple[Tab, ReviewServer], way: str
) -> None:
    page, _ = compared
    other = "beside" if way == "swipe" else "swipe"
    picture = "document.querySelector('#view-compare canvas').toDataURL()"
    page.page.select_option("[aria-label='how to compare']", other)
    before = settled(page, picture)
    page.page.select_option("[aria-label='how to compare']", way)
    page.until(f"{picture} !== {json.dumps(before)}")
    apart = way.startswith("difference")
    assert page.page.locator("[aria-label='what is shown']").is_disabled() is apart
    assert page.page.locator("#wipe").is_disabled() is (way != "swipe")
    legend = page.page.locator("#view-compare .legend")
    assert ("mm" in legend.inner_text()) is apart


def settled(page: Tab, picture: str) -> str:
    """Return the picture once it has stopped changing, with all its tiles loaded."""
    before, now = "", str(page.js(picture))
    while before != now:
        page.page.wait_for_timeout(patience(300))
        before, now = now, str(page.js(picture))
    return now


def test_the_divider_of_the_two_halves_moves_by_mouse_and_by_keyboard(
    compared: tuple[Tab, ReviewServer],
) -> None:
    page, _ = compared
    page.page.select_option("[aria-label='how to compare']", "swipe")
    page.page.locator("#view-compare canvas").focus()
    page.js("document.querySelector('#wipe').value = 50")
    page.keys(".", ".", ",")
    assert page.page.locator("#wipe").input_value() == "55"
    before = page.js(_PLACES)
    page.keys("ArrowRight")
    assert page.js(_PLACES)[0] > before[0]
    page.page.locator("#view-compare canvas").click(position={"x": 40, "y": 60})
    assert page.js(_PLACES) != before


@pytest.mark.parametrize("name", ["growth.csv", "growth.json"])
def test_the_tables_can_be_downloaded(compared: tuple[Tab, ReviewServer], name: str) -> None:
    page, server = compared
    with page.page.expect_download() as taken:
        page.page.locator(f"#compare a[download='{name}']").click()
    assert Path(taken.value.path()).read_bytes() == server.ask(f"/api/comparison/{name}").body


def test_without_an_earlier_run_the_tab_says_how_to_give_one(page: Tab) -> None:
    page.page_of("Compare")
    page.page.locator("#compare code").wait_for()
    assert "boresight review RUN --compare EARLIER" in page.page.locator("#compare").inner_text()
