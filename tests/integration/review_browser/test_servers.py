"""Several tabs, lost servers, runs computed again, markup in texts, and the copy that needs no server."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

from tests.patience import patience
from tests.review_browser import Tab, tab
from tests.review_server import ReviewServer
from tests.sample_run import rerun_sample
from tests.shared_data import PROJECT_ROOT


def test_two_tabs_at_once(page: Tab, context, server: ReviewServer) -> None:
    """Decisions in one tab appear in another, and no decision on an outdated view is accepted."""
    with tab(context, server.origin) as other:
        other.open(server.origin + "/")
        other.choose("1")
        page.choose("2")
        other.js(
            "boresight.session.isAsking = true"
        )  # no query of the server, sent every few seconds, comes in between
        with page.one_change():
            page.keys("a")
        other.page.keyboard.press("a")
        other.until("document.querySelector('.notice').textContent.includes('made elsewhere')")
        assert other.finding("2")["status"] == "accepted"
        assert other.finding("1")["status"] == "open", "a decision made on an outdated view is not accepted"
        other.js("boresight.session.isAsking = false")
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
            for keys in ("a", "o", "a"):
                page.choose("1")  # after a decision the next finding is chosen
                with page.one_change():
                    page.keys(keys)
            page.choose("1")
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
            assert server.port == old, "the page that stayed open connects to the new server"
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
        assert worker.wait(timeout=patience(600)) == 0
        page.js("boresight.session.refresh()")
        page.until("document.querySelector('.notice').textContent.includes('computed again')")
        page.page.click("text=Load the new results")
        page.page.wait_for_selector(".list .row")
        page.until("window.boresight")
        left = page.js("boresight.session.state.findings.map((f) => [f.kind, f.status])")
        assert left == [["dent", "accepted"]], "decisions stay with their finding"
        page.keys("3")
        assert "Decisions without their finding" in page.page.locator(".page:visible").inner_text()
    context.close()


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
