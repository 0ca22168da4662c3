"""Every action of the review's page, by mouse or keyboard, in a real Chromium on a real server."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.review_browser import Tab, chromium, tab
from tests.review_server import ReviewServer
from tests.sample_run import rerun_sample
from tests.shared_data import PROJECT_ROOT

SPOT = (60.0, -1.2)
_RADII = """(() => {
  const { parts, pipe } = boresight.model, a = parts[0].mesh.geometry.getAttribute('position').array;
  let low = 1e9, high = 0;
  for (let k = 0; k < a.length; k += 3) {
    const r = pipe.coordinates([a[k] * 1e3, a[k + 1] * 1e3, a[k + 2] * 1e3]).radius;
    low = Math.min(low, r);
    high = Math.max(high, r);
  }
  return [low, high]; })()"""


@pytest.fixture(scope="module")
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
    """The one tab, on its first page; afterwards everything done is undone."""
    shared_tab.page_of("Inspect")
    shared_tab.js("boresight.session.take('none')")
    shared_tab.focus_list()
    yield shared_tab
    state = server.ask("/api/state").json()
    while state["may_undo"]:
        state = server.act(state["revision"], do="undo").json()
    shared_tab.js("boresight.session.refresh()")
    shared_tab.until(f"boresight.session.state.revision === {state['revision']}")


def cursor(page: Tab) -> tuple[float, float]:
    return tuple(page.js("boresight.session.cursor"))


def status(page: Tab) -> str:
    return page.page.locator("#view-flat .status").inner_text()


def turned(a: float, b: float) -> float:
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def told(page: Tab, place: str, old: str) -> str:
    """Return what a view says once it no longer says ``old``."""
    page.until(f"document.querySelector('{place} .told').textContent !== {json.dumps(old)}")
    return page.page.locator(f"{place} .told").inner_text()


# Linked views


def test_a_click_on_the_wall_moves_all_views(page: Tab) -> None:
    page.show_wall(60, -1.5, 0.25)
    frame, section = (page.page.locator(f"{v} .told").inner_text() for v in ("#view-frame", "#view-section"))
    marker = page.js("boresight.model.marker.position.toArray()")
    page.click_wall(SPOT)
    distance, azimuth = cursor(page)
    assert (distance, azimuth) == pytest.approx(SPOT, abs=0.4)
    assert "Frame" in told(page, "#view-frame", frame)
    assert "Radius at" in told(page, "#view-section", section)
    assert page.js("boresight.model.marker.position.toArray()") != marker
    assert status(page).startswith(f"Spot at {distance:.1f} mm, 12:")


def test_a_click_on_the_model_moves_to_what_was_clicked(page: Tab) -> None:
    page.js("boresight.session.moveTo([70, -2.4])")
    x, y = page.js("""(() => {
        const m = boresight.model, box = m.canvas.getBoundingClientRect();
        m.camera.updateMatrixWorld(); const p = m.marker.position.clone().project(m.camera);
        return [(p.x + 1) / 2 * box.width, (1 - p.y) / 2 * box.height]; })()""")
    page.js("boresight.session.moveTo([30, 1.0])")
    page.js("boresight.model.flown = 70 - boresight.session.run.radius_mm * 1.1, boresight.model.fly(0)")
    page.page.locator(".model canvas").click(position={"x": x, "y": y})
    distance, azimuth = cursor(page)
    assert abs(distance - 70) < 1.5
    assert turned(azimuth, -2.4) < 0.03


def test_a_click_on_the_frame_moves_to_what_was_clicked(page: Tab) -> None:
    page.js("boresight.session.moveTo([66, 0.4])")
    page.until("document.querySelector('.zoomed circle.spot')")
    told(page, "#view-frame", "")
    page.page.uncheck("#close-up")
    page.until("boresight.session.cursor[0] === 66 && document.querySelector('.zoomed img').complete")
    page.page.wait_for_timeout(400)
    box = page.page.locator(".zoomed circle.spot").bounding_box()
    page.js("boresight.session.cursor = [20, -3]")  # moved without any view being told
    page.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.until("boresight.session.cursor[0] !== 20")
    distance, azimuth = cursor(page)
    page.page.check("#close-up")
    assert abs(distance - 66) < 2
    assert turned(azimuth, 0.4) < 0.05


def test_a_click_on_the_section_turns_only(page: Tab) -> None:
    page.js("boresight.session.moveTo([50, -1.5])")
    box = page.page.locator(".section svg[role=img]").bounding_box()
    page.page.mouse.click(box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2)
    assert cursor(page)[0] == 50
    assert turned(cursor(page)[1], 0) < 0.05


def test_every_overlay_dresses_wall_and_model(page: Tab) -> None:
    names = page.js("boresight.session.run.overlays.map((o) => o.name)")
    assert len(names) >= 4
    for name in [*names, "photo"]:
        page.page.select_option('select[aria-label="what the wall shows"]', name)
        page.until(f"boresight.flat.picture.shown === '{name}'")
        variant = {"deviation_nominal": "deviation"}.get(name, name)
        worn = page.js("boresight.model.parts.map((p) => p.mesh.material.name)")
        assert worn
        assert all(w.startswith(variant) for w in worn)
        assert ("mm" in page.page.locator(".legend").inner_text()) == (name != "photo")


def test_relief_is_exaggerated_about_the_round_pipe(page: Tab) -> None:
    def radii() -> tuple[float, float]:
        return tuple(page.js(_RADII))

    radius = page.js("boresight.session.run.radius_mm")
    plain = np.array(radii()) - radius
    page.page.fill("#gain", "5")
    assert np.array(radii()) - radius == pytest.approx(5 * plain, rel=0.02)
    page.page.fill("#gain", "1")
    assert np.array(radii()) - radius == pytest.approx(plain, abs=1e-3)


def test_the_model_is_cut_open_from_outside_only(page: Tab) -> None:
    planes = "boresight.model.parts.every((p) => p.mesh.material.clippingPlanes.length === {})"
    page.page.click("text=Outside")
    page.page.check("#cut")
    page.until(planes.format(1))
    page.page.click("text=Inside")
    page.until(planes.format(0))
    assert page.page.locator("#cut").is_disabled()
    page.page.click("text=Outside")
    page.page.uncheck("#cut")
    page.until(planes.format(0))
    page.page.click("text=Inside")


def test_the_keyboard_flies_inside(page: Tab) -> None:
    page.keys("g")
    before = page.js("[boresight.model.flown, boresight.model.look.yaw, boresight.model.frameTimes.length]")
    page.keys("w", "w", "Shift+W", "s", "d")
    flown, yaw = page.js("[boresight.model.flown, boresight.model.look.yaw]")
    assert flown - before[0] == pytest.approx(6 + 6 + 30 - 6)
    assert yaw < before[1]
    assert page.standing(), "D beside the model looks around; it adds no defect"
    assert page.js("boresight.session.tool") == "none"


def test_at_rest_the_model_is_sharp_and_not_drawn_on(page: Tab) -> None:
    page.page.locator(".model canvas").focus()
    for _ in range(12):
        page.keys("w")
    page.page.wait_for_timeout(900)
    drawn = "boresight.model.renderer.info.render.frame"
    before = page.js(drawn)
    page.page.wait_for_timeout(900)
    assert page.js(drawn) == before
    assert page.js("boresight.model.renderer.getPixelRatio() / boresight.model.pixelRatio") == pytest.approx(
        1
    )


# Findings


def test_decisions_by_keyboard_alone(page: Tab) -> None:
    rank = {"pit": 1, "corrosion": 1, "dent": 2}
    rows = page.page.locator(".list .row strong").all_inner_texts()
    assert [rank[r.split()[1]] for r in rows] == sorted(rank[r.split()[1]] for r in rows)
    page.choose("1")
    with page.one_change():
        page.keys("a")
    page.keys("n")
    chosen = page.js("boresight.session.selected")
    page.keys("r")
    page.page.keyboard.type("reflection")
    with page.one_change():
        page.keys("Enter")
    page.keys("c")
    page.page.keyboard.type("seen in frame 12")
    with page.one_change():
        page.keys("Enter")
    first, second = page.finding("1"), page.finding(chosen)
    assert (first["status"], first["decided_by"]) == ("accepted", "Ada")
    assert first["decided_at"].startswith("20")
    assert (second["status"], second["reason"]) == ("rejected", "reflection")
    assert [(r["who"], r["text"]) for r in second["remarks"]] == [("Ada", "seen in frame 12")]
    page.focus_list()
    for keys in ("Control+z", "Control+z", "Control+Shift+z"):
        with page.one_change():
            page.keys(keys)
    assert page.finding(chosen)["status"] == "rejected"
    assert page.finding(chosen)["remarks"] == []
    with page.one_change():
        page.keys("o")
    assert page.finding(page.js("boresight.session.selected"))["status"] == "open"


def test_without_a_name_nothing_is_decided(page: Tab) -> None:
    page.page.fill("#who", "")
    page.page.locator("#who").press("Tab")
    page.focus_list()
    before = page.revision
    page.keys("a")
    assert "Give your name" in page.page.locator(".notice").inner_text()
    assert page.js("document.activeElement.id") == "who"
    page.named("Ada")
    assert page.revision == before


def test_reclassified_and_redrawn_stands_beside_the_original(page: Tab) -> None:
    page.choose("2")
    measured = page.finding("2")
    with page.one_change():
        page.page.select_option('select[aria-label="kind"]', "deposit")
    low, high = (f([p[0] for p in measured["outline"]]) for f in (min, max))
    middle = sum(p[1] for p in measured["outline"]) / len(measured["outline"])
    page.show_wall((low + high) / 2, middle, 0.3)
    page.focus_list()
    page.keys("e")
    page.click_wall(
        (low - 3, middle - 0.2), (high + 3, middle - 0.2), (high + 3, middle + 0.2), (low - 3, middle + 0.2)
    )
    with page.one_change():
        page.page.click("text=Done")
    now = page.finding("2")
    assert (now["kind"], now["edited"], now["original"]) == ("deposit", True, 2)
    assert now["size"]["length_mm"] == pytest.approx(high - low + 6, abs=1)
    assert now["size"]["depth_mm"] == pytest.approx(measured["size"]["depth_mm"], abs=0.5)
    shown = page.page.locator(".original").inner_text()
    assert shown.startswith("As measured")
    assert "Dent" in shown


def test_an_outline_is_drawn_with_the_keyboard_alone(page: Tab) -> None:
    page.js("boresight.session.moveTo([50, 0.5])")
    page.keys("d")
    for steps in (
        ("Enter",),
        ("Shift+ArrowRight", "Enter"),
        ("Shift+ArrowDown", "Enter", "Enter", "Backspace"),
    ):
        page.keys(*steps)
    assert len(page.js("boresight.session.drawn")) == 3
    page.page.select_option('select[aria-label="kind of the missed defect"]', "gouge")
    page.page.locator(".flat canvas").focus()
    with page.one_change():
        page.keys("Control+Enter")
    made = page.finding(f"a{page.revision}")
    assert (made["kind"], made["status"], len(made["outline"])) == ("gouge", "accepted", 3)
    assert made["size"]["depth_sigma_mm"] > 0


def test_merge_and_split(page: Tab) -> None:
    page.choose("1")
    page.keys("x")
    page.choose("3")
    page.keys("x")
    with page.one_change():
        page.keys("m")
    merged = f"m{page.revision}"
    assert merged in page.standing()
    assert not {"1", "3"} & set(page.standing())
    assert page.finding(merged)["made_of"] == ["1", "3"]
    page.focus_list()
    with page.one_change():
        page.keys("Control+z")
    assert {"1", "3"} <= set(page.standing())
    page.choose("2")
    page.keys("s")
    s, a = np.mean(page.finding("2")["outline"], axis=0)
    page.show_wall(float(s), float(a), 0.3)
    page.click_wall((s - 8, a - 0.1), (s - 1, a - 0.1), (s - 4, a + 0.1))
    page.keys(",")
    page.click_wall((s + 1, a - 0.1), (s + 8, a - 0.1), (s + 4, a + 0.1))
    with page.one_change():
        page.page.click("text=Done")
    assert {"2.1", "2.2"} <= set(page.standing())
    assert "2" not in page.standing()


def test_assumed_wall_gives_loss_and_strength(page: Tab) -> None:
    page.page_of("Sign-off")
    page.page.fill("#wall", "6")
    page.page.fill("#yield", "360")
    with page.one_change():
        page.page.click("text=Use for wall loss")
    found = page.finding("1")
    assert found["wall_loss_percent"] == pytest.approx(100 * found["size"]["depth_mm"] / 6)
    page.page_of("Inspect")
    page.choose("1")
    shown = page.page.locator(".detail table").inner_text()
    assert "modified B31G" in shown
    assert "%" in shown
    page.until("document.querySelectorAll('.curves .chart').length === 2")


# Measuring


@pytest.mark.parametrize(
    ("tool", "places", "names"),
    [
        ("Point", [(60, -1.2)], ["radius", "distance", "clock"]),
        ("Distance", [(50, -1.4), (70, -1.1)], ["along the wall", "straight"]),
        ("Area", [(50, -1.4), (70, -1.4), (70, -1.0), (50, -1.0)], ["area"]),
        ("Depth", [(50, -1.4), (70, -1.4), (70, -1.0), (50, -1.0)], ["depth"]),
        ("Diameter", [(60, -1.2)], ["diameter", "mean diameter"]),
    ],
)
def test_every_tool_gives_its_sigma(page: Tab, tool: str, places: list[Any], names: list[str]) -> None:
    page.show_wall(60, -1.2, 0.3)
    page.page.click(f'.tools button:text-is("{tool}")')
    page.click_wall(*places)
    page.until("document.querySelector('#view-flat .status').textContent.includes('±')")
    said = status(page)
    assert all(f"{name} " in said for name in names)
    assert said.count("±") == len(names)
    if tool == "Distance":
        assert 20 < float(said.split("straight ")[1].split(" ")[0]) < 40


def test_the_model_can_be_measured_on(page: Tab) -> None:
    page.page.click('.tools button:text-is("Point")')
    page.js("boresight.model.flown = 20, boresight.model.look = {yaw: 0, pitch: 0}, boresight.model.fly(0)")
    box = page.page.locator(".model canvas").bounding_box()
    page.page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
    page.until("document.querySelector('#view-flat .status').textContent.includes('±')")
    assert "radius" in status(page)


# Quality, signing, papers


def test_the_quality_page_tells_how_good_the_run_is(page: Tab) -> None:
    page.keys("2")
    shown = page.page.locator(".page:visible")
    shown.locator(".plots figure").first.wait_for()
    captions = " ".join(shown.locator("figcaption").all_inner_texts())
    for word in ("Wall seen", "1 σ of the radius", "Diameter", "Drift", "not used"):
        assert word in captions
    text = shown.inner_text()
    for word in ("laser frames rejected whole", "probe file written", "Left-out physics", "SHA-256"):
        assert word in text


def test_any_later_change_shows_as_unsigned(page: Tab) -> None:
    page.keys("3")
    page.page.fill("#sign-name", "Ada Lovelace")
    page.page.fill("#sign-standard", "POF 100")
    page.page.fill("#sign-remarks", "dry pipe")
    page.page.click('button:text-is("Sign")')
    badge = "document.querySelector('.badge').textContent === '{}'"
    page.until(badge.format("signed"))
    assert "Signed by Ada Lovelace" in page.page.locator(".page:visible").inner_text()
    page.page_of("Inspect")
    page.choose("1")
    with page.one_change():
        page.keys("a")
    page.until(badge.format("changed since signed"))
    with page.one_change():
        page.keys("Control+z")
    page.until(badge.format("signed"))


def test_a_file_of_the_run_changed_behind_its_back_shows_as_unsigned(page: Tab, run: Path) -> None:
    page.keys("3")
    page.page.fill("#sign-name", "Ada")
    page.page.click('button:text-is("Sign")')
    page.until("boresight.session.seal?.signed")
    table = run / "sections.csv"
    before = table.read_bytes()
    table.write_bytes(before.replace(b"1", b"2", 1))
    page.js("boresight.session.refresh()")
    page.until("boresight.session.seal && !boresight.session.seal.signed")
    table.write_bytes(before)
    page.js("boresight.session.refresh()")
    page.until("boresight.session.seal?.signed")


def test_every_paper_can_be_taken_away(page: Tab) -> None:
    page.keys("3")
    links = page.page.locator(".papers a")
    starts = {
        "report.pdf": b"%PDF-",
        "report.html": b"<!doctype html>",
        "findings.csv": b"\xef\xbb\xbfid,",
        "findings.json": b"{",
        "pof.csv": b"\xef\xbb\xbffeature_id,",
        "pictures.zip": b"PK",
    }
    assert links.count() == len(starts)
    for k in range(links.count()):
        address = links.nth(k).get_attribute("href")
        answer = page.page.request.get(page.origin + address)
        assert answer.body().startswith(starts[address.rsplit("/", 1)[1]])
    with page.page.context.expect_page() as opened, page.page.expect_popup():
        links.filter(has_text="Findings, CSV").click()
    opened.value.close()


# More than one tab, lost servers, runs made anew


def test_two_tabs_at_once(page: Tab, context, server: ReviewServer) -> None:
    with tab(context, server.origin) as other:
        other.open(server.origin + "/")
        other.choose("1")
        page.choose("2")
        with page.one_change():
            page.keys("a")
        other.page.keyboard.press("a")
        other.until("document.querySelector('.notice').textContent.includes('made elsewhere')")
        assert other.finding("2")["status"] == "accepted"
        assert other.finding("1")["status"] == "open", "what was decided on an old view is not taken"
        other.focus_list()
        with other.one_change():
            other.keys("a")
        page.until("boresight.session.state.findings.find((f) => f.id === '1').status === 'accepted'")


def test_nothing_is_lost_when_the_server_dies(browser, sample: Path, tmp_path: Path) -> None:
    shutil.copytree(sample, tmp_path / "run")
    server = ReviewServer(tmp_path / "run")
    server.start()
    context = browser.new_context()
    try:
        with tab(context, server.origin) as page:
            page.open(server.address)
            page.named("Ada")
            page.choose("1")
            for keys in ("a", "o", "a"):
                with page.one_change():
                    page.keys(keys)
            page.keys("c")
            page.page.keyboard.type("half written")
            page.js("setTimeout(() => void boresight.session.act({do: 'accept', finding: '2'}), 0)")
            server.kill()
            page.keys("Enter")
            page.until("document.querySelector('.notice').textContent.includes('Start it again')")
            page.until("document.querySelector('.comment input').value === 'half written'")
            old = server.port
            server.port = 0
            server.start()
            assert server.port == old, "the page that was left open finds its server again"
            with tab(context, server.origin) as fresh:
                fresh.open(server.address)
                assert fresh.finding("1")["status"] == "accepted"
                assert [e["action"]["do"] for e in fresh.js("boresight.session.state.history")][:3] == [
                    "accept", "reopen", "accept",
                ]  # fmt: skip
            page.until("!document.querySelector('.notice').textContent.includes('Start it again')")
            page.page.locator(".comment input").focus()
            with page.one_change():
                page.keys("Enter")
            assert page.finding("1")["remarks"][0]["text"] == "half written"
    finally:
        context.close()
        server.kill()


def test_a_run_computed_anew_while_open(browser, sample: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(sample, run)
    context = browser.new_context()
    with ReviewServer(run) as server, tab(context, server.origin) as page:
        page.open(server.address)
        page.named("Ada")
        kinds = {f: page.finding(f)["kind"] for f in page.standing()}
        for name in kinds:
            page.choose(name)
            with page.one_change():
                page.keys("a")
        worker = rerun_sample(run, "defects.min_depth_mm=1.3")
        assert worker.wait(timeout=600) == 0
        page.js("boresight.session.refresh()")
        page.until("document.querySelector('.notice').textContent.includes('computed again')")
        page.page.click("text=Load the new results")
        page.page.wait_for_selector(".list .row")
        page.until("window.boresight")
        left = page.js("boresight.session.state.findings.map((f) => [f.kind, f.status])")
        assert left == [["dent", "accepted"]], "decisions follow their finding"
        page.keys("3")
        assert "Decisions without their finding" in page.page.locator(".page:visible").inner_text()
    context.close()


# Strange texts, and the copy that opens without a server


def test_markup_is_shown_as_text(browser, sample: Path, tmp_path: Path) -> None:
    hostile = "<img src=x onerror=alert(1)><script>alert(2)</script>"
    run = tmp_path / "run"
    shutil.copytree(sample, run)
    record = json.loads((run / "run.json").read_text("utf-8"))
    record["recording"]["name"] = record["metrics"][0]["name"] = hostile
    record["reader_warnings"] = [hostile]
    (run / "run.json").write_text(json.dumps(record))
    context = browser.new_context()
    with ReviewServer(run) as server, tab(context, server.origin) as page:
        assert server.act(0, who=hostile, do="comment", finding="1", text=hostile).code == 200
        page.open(server.address)
        page.choose("1")
        assert hostile in page.page.locator(".remark").inner_text()
        assert hostile in page.page.locator("h1").inner_text()
        for name in ("Quality", "Sign-off"):
            page.page_of(name)
            assert hostile in page.page.locator(".page:visible").inner_text()
        assert page.js("document.querySelectorAll('body script, img[src=x]').length") == 0
    context.close()


def test_an_export_opens_from_the_disk_and_changes_nothing(browser, sample: Path, tmp_path: Path) -> None:
    run, copy = tmp_path / "run", tmp_path / "copy"
    shutil.copytree(sample, run)
    command = [sys.executable, "-m", "pipeline.cli", "review", str(run), "--export", str(copy)]
    assert subprocess.run(command, cwd=PROJECT_ROOT, capture_output=True, check=True)
    context = browser.new_context(offline=True)
    with tab(context, "file://") as page:
        page.open((copy / "index.html").as_uri(), model=True)
        assert "read-only" in page.page.locator("header").inner_text()
        assert page.page.locator("main button.accept").count() == 0
        page.choose("1")
        page.until("document.querySelector('.zoomed img')?.naturalWidth > 100")
        page.until("[...boresight.flat.picture.tiles.values()].some((t) => t.naturalWidth)")
        page.page_of("Quality")
        page.page.locator(".plots figure").first.wait_for()
    context.close()
