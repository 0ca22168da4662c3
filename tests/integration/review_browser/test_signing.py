"""Quality, signing and papers."""

from __future__ import annotations

from pathlib import Path

from tests.patience import patience
from tests.review_browser import Tab


def test_the_quality_page_shows_how_good_the_run_is(page: Tab) -> None:
    page.keys("2")
    shown = page.page.locator(".page:visible")
    shown.locator(".plots figure").first.wait_for()
    captions = " ".join(shown.locator("figcaption").all_inner_texts())
    for word in ("Wall seen", "1 σ of the radius", "Diameter", "Drift", "not used"):
        assert word in captions
    text = shown.inner_text()
    for word in ("laser frames rejected whole", "probe file written", "Instrument diagnosis", "SHA-256"):
        assert word in text


def test_signing_with_undecided_findings_needs_a_confirmation(page: Tab) -> None:
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


def test_after_any_later_change_the_review_is_shown_as_unsigned(page: Tab) -> None:
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


def test_after_a_change_of_a_file_of_the_run_the_review_is_shown_as_unsigned(page: Tab, run: Path) -> None:
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


def test_the_client_is_entered_on_the_page_and_printed(page: Tab) -> None:
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
    assert page.page.input_value("#fact-client") == "", "fields show the stored value, also after an undo"
    assert page.page.input_value("#fact-site") == "half written", "but text that is being typed is kept"
    page.page.fill("#fact-site", "")


def test_updates_from_the_server_leave_the_focus_in_the_field_being_edited(page: Tab) -> None:
    """A field lost it when the signature arrived; what was typed next then acted as shortcuts."""
    page.keys("3")
    page.page.fill("#wall", "")
    page.page.focus("#wall")
    with page.one_change():
        page.js("boresight.session.act({do: 'describe', site: 'Hall 1'})")
    page.until("boresight.session.seal !== null")
    page.keys("6")
    assert page.page.input_value("#wall") == "6"
    page.page.fill("#wall", "")


def test_every_paper_can_be_downloaded(page: Tab) -> None:
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
