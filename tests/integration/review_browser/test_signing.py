"""Quality, signing and papers."""

from __future__ import annotations

from pathlib import Path

from tests.patience import patience
from tests.review_browser import Tab


def test_the_quality_page_tells_how_good_the_run_is(page: Tab) -> None:
    page.keys("2")
    shown = page.page.locator(".page:visible")
    shown.locator(".plots figure").first.wait_for()
    captions = " ".join(shown.locator("figcaption").all_inner_texts())
    for word in ("Wall seen", "1 σ of the radius", "Diameter", "Drift", "not used"):
        assert word in captions
    text = shown.inner_text()
    for word in ("laser frames rejected whole", "probe file written", "Instrument diagnosis", "SHA-256"):
        assert word in text


def test_who_signs_with_findings_undecided_must_say_so(page: Tab) -> None:
    page.keys("3")
    shown = page.page.locator(".page:visible")
    assert "undecided. Sign nevertheless" in shown.inner_text()
    page.page.fill("#sign-name", "Ada")
    page.page.uncheck("#sign-undecided")
    page.page.click('button:text-is("Sign")')
    page.page.wait_for_timeout(patience(500))
    assert page.js("boresight.session.seal.signature") is None
    for words in ("Pipe data", "Downloads"):
        assert words in shown.locator("h2").all_inner_texts()


def test_any_later_change_shows_as_unsigned(page: Tab) -> None:
    page.keys("3")
    page.page.fill("#sign-name", "Ada Lovelace")
    page.page.fill("#sign-standard", "POF 100")
    page.page.fill("#sign-remarks", "dry pipe")
    page.page.check("#sign-undecided")
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
    page.page.check("#sign-undecided")
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


def test_for_whom_it_was_inspected_is_given_on_the_page_and_printed(page: Tab) -> None:
    page.keys("3")
    page.page.fill("#fact-client", "Water Works")
    page.page.fill("#fact-date", "2026-05-31")
    with page.one_change():
        page.page.click('button:text-is("Use in the reports")')
    facts = page.page.request.get(f"{page.origin}/api/papers/findings.json").json()["facts"]
    assert facts == [["Client", "Water Works"], ["Date", "2026-05-31"]]
    page.page.fill("#fact-site", "half written")
    with page.one_change():
        page.page.click("text=Undo")
    assert page.page.input_value("#fact-client") == "", "fields show what is known, also after an undo"
    assert page.page.input_value("#fact-site") == "half written", "but keep what is being written"
    page.page.fill("#fact-site", "")


def test_news_leave_the_focus_where_something_is_being_written(page: Tab) -> None:
    """A field lost it when the seal came, and what was typed next were shortcuts that decide on findings."""
    page.keys("3")
    page.page.fill("#wall", "")
    page.page.focus("#wall")
    with page.one_change():
        page.js("boresight.session.act({do: 'describe', site: 'Hall 1'})")
    page.until("boresight.session.seal !== null")
    page.keys("6")
    assert page.page.input_value("#wall") == "6"
    page.page.fill("#wall", "")


def test_every_paper_can_be_taken_away(page: Tab) -> None:
    page.keys("3")
    links = page.page.locator(".papers a")
    starts = {
        "report.pdf": b"%PDF-",
        "report.html": b"<!doctype html>",
        "findings.csv": b"\xef\xbb\xbfid,",
        "findings.json": b"{",
        "pof.csv": b"\xef\xbb\xbfLog distance [m],",
        "pacp.csv": b"\xef\xbb\xbfConditionID,",
        "en13508-2.txt": b"#A1=",
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
