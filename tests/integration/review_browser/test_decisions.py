"""Decisions by mouse and by keyboard alone: accept, redraw, merge, split, undo.

It also tests results with an assumed wall.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.patience import patience
from tests.review_browser import Tab


def test_decisions_by_keyboard_alone(page: Tab) -> None:
    rank = {"pit": 1, "corrosion": 1, "dent": 2}
    rows = page.page.locator(".list .row strong").all_inner_texts()
    assert [rank[r.split()[1]] for r in rows] == sorted(rank[r.split()[1]] for r in rows)
    page.choose("1")
    with page.one_change():
        page.keys("a")
    chosen = page.js("boresight.session.selected")
    assert chosen != "1", "after a decision the next undecided finding is chosen"
    page.keys("r")
    page.page.keyboard.type("reflection")
    with page.one_change():
        page.keys("Enter")
    page.until(f"boresight.session.selected !== {chosen!r}")
    page.choose(chosen)
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


def test_a_finding_is_not_rejected_without_a_reason(page: Tab) -> None:
    page.choose("1")
    before = page.revision
    page.keys("r")
    assert "Why reject finding 1?" in page.page.locator("form.reason").inner_text()
    for text in ("", "   "):
        page.page.fill("#reason", text)
        page.keys("Enter")
        page.page.wait_for_timeout(patience(300))
        assert page.revision == before
    page.keys("Escape")


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


def test_a_reclassified_and_redrawn_finding_is_shown_beside_the_original(page: Tab) -> None:
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


def test_a_kind_that_contradicts_the_measured_depth_raises_a_warning(page: Tab) -> None:
    pit = next(f for f in page.standing() if page.finding(f)["size"]["depth_mm"] > 0.5)
    with page.one_change():
        page.js(
            "void boresight.session.act({do: 'add', kind: 'deposit',"
            f" outline: boresight.session.state.findings.find((f) => f.id === {pit!r}).outline}})"
        )
    page.choose(f"a{page.revision}")
    assert "A deposit stands into the bore, but" in page.page.locator(".detail .caution").inner_text()
    assert "4 (added) deposit" in page.page.locator(".list").inner_text()
    page.page_of("Sign-off")
    assert "added a deposit" in page.page.locator(".history").inner_text()


def test_an_outline_is_changed_by_dragging_its_points_and_the_page_says_why_the_depth_changed(
    page: Tab,
) -> None:
    page.choose("2")
    page.js("(boresight.flat.view.mmPerPx *= 1.0, boresight.flat.paint())")
    page.keys("e")
    before = page.js("boresight.session.drawn")
    assert len(before) == len(page.finding("2")["outline"])
    x, y = page.js("(([s, a]) => [boresight.flat.x(s), boresight.flat.y(a)])(boresight.session.drawn[0])")
    box = page.page.locator(".flat canvas").bounding_box()
    page.page.mouse.move(box["x"] + x, box["y"] + y)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + x - 10, box["y"] + y - 10, steps=3)
    page.page.mouse.up()
    after = page.js("boresight.session.drawn")
    assert after[0] != before[0]
    assert after[1:] == before[1:]
    with page.one_change():
        page.page.click("text=Done")
    assert "In this way, the run's outline gives" in page.page.locator(".detail .caution").inner_text()


def test_caps_lock_and_focus_do_not_change_what_a_key_does(page: Tab) -> None:
    page.choose("1")
    with page.one_change():
        page.js(
            "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {key: 'A', bubbles: true}))"
        )
    assert page.finding("1")["status"] == "accepted"
    page.choose("2")
    page.keys("g")
    page.keys("r")
    assert "Why reject finding 2?" in page.page.locator("form.reason").inner_text()
    page.keys("Escape")


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


def test_with_an_assumed_wall_thickness_loss_and_strength_are_shown(page: Tab) -> None:
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
