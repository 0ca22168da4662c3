"""The review in Firefox: all panes are filled, a finding is decided, the review signed, a report made."""

from __future__ import annotations

from pathlib import Path

from tests.firefox import firefox
from tests.review_server import ReviewServer


def test_from_the_first_view_to_the_signed_report(server: ReviewServer, tmp_path: Path) -> None:
    with firefox(tmp_path) as page:
        page.ask("WebDriver:SetWindowRect", width=1280, height=800)
        page.ask("WebDriver:Navigate", url=server.address)
        page.until("!!window.boresight && document.querySelectorAll('.list .row').length > 0")
        page.until("[...boresight.flat.picture.tiles.values()].some((t) => t.naturalWidth > 0)")
        page.until("document.querySelectorAll('.section path.measured').length > 0")
        page.until("[...document.querySelectorAll('.shots img')].some((i) => i.naturalWidth > 0)")
        page.until(
            "boresight.model.isReady || document.querySelector('.veil')?.textContent.includes('no 3D')", 60
        )
        page.js("(boresight.session.who = 'Ada', 1)")
        first = page.js("boresight.session.selected")
        page.js("(document.querySelector('.detail button.accept').click(), 1)")
        page.until(f"boresight.session.state.findings.find((f) => f.id === '{first}').status === 'accepted'")
        page.js("(document.querySelector('[data-page=\"Sign-off\"]').click(), 1)")
        page.until("boresight.session.seal !== null")
        page.js("(document.querySelector('#sign-undecided').click(), 1)")
        page.js("(document.querySelector('#sign-name').value = 'Ada', 1)")
        page.js("(document.querySelector('#sign-name').form.requestSubmit(), 1)")
        page.until("boresight.session.seal?.signed === true")
        seen = page.js("document.querySelector('.badge').textContent")
    assert seen == "signed"
    report = server.ask("/api/papers/report.pdf")
    assert report.code == 200
    assert report.body.startswith(b"%PDF")
