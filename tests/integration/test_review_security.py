"""The review's server refuses strangers, serves no file outside its folder, and shows markup as text."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.review.guard import HEADERS
from pipeline.review.run_files import RunFiles
from tests.review_server import ReviewServer

HOSTILE = "<img src=x onerror=alert(1)><script>alert(2)</script>"
SECRET = "the inspector's own"
READ = ("/", "/api/run", "/api/state", "/api/seal", "/api/quality", "/api/model", "/api/model/0.glb",
        "/assets/page.js", "/api/tiles/photo", "/api/tiles/photo/0/0/0.png", "/api/frames/0.jpg",
        "/api/papers/findings.csv",
        "/api/section?distance=40", "/api/profile?distance=40&azimuth=0&half=10",
        "/api/sights?distance=40&azimuth=0")  # fmt: skip
WRITE = ("/api/actions", "/api/sign", "/api/measure")


@pytest.fixture(scope="module")
def run(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample's run as a stranger could have sent it.

    Markup in every text, and a secret file beside it.
    """
    folder = tmp_path_factory.mktemp("strange")
    (folder / "secret.txt").write_text(SECRET)
    made = folder / "run"
    shutil.copytree(sample, made)
    record = json.loads((made / "run.json").read_text("utf-8"))
    record["recording"]["name"] = HOSTILE
    record["reader_warnings"] = [HOSTILE]
    record["metrics"][0]["name"] = HOSTILE
    (made / "run.json").write_text(json.dumps(record))
    defects = json.loads((made / "defects.json").read_text("utf-8"))
    defects[0]["statement"] = HOSTILE
    (made / "defects.json").write_text(json.dumps(defects))
    return made


@pytest.fixture(scope="module")
def server(run: Path):
    with ReviewServer(run) as started:
        yield started


@pytest.mark.parametrize("path", READ)
def test_the_page_is_answered(server: ReviewServer, path: str) -> None:
    """Without this test the refusals below would prove nothing."""
    assert server.ask(path).code == 200


@pytest.mark.parametrize("path", READ)
@pytest.mark.parametrize(
    ("what", "code"),
    [
        ({"cookie": ""}, 403),
        ({"cookie": "boresight-{port}="}, 403),
        ({"cookie": "boresight-{port}=wrong"}, 403),
        ({"host": "example.org"}, 421),
        ({"host": "example.org:{port}"}, 421),
        ({"host": "127.0.0.1"}, 421),
        ({"host": ""}, 400),
    ],
)
def test_requests_without_the_token_may_not_read(
    server: ReviewServer, path: str, what: dict[str, str], code: int
) -> None:
    answer = server.ask(path, **{k: v.format(port=server.port) for k, v in what.items()})
    assert answer.code == code
    assert len(answer.body) < 100


@pytest.mark.parametrize("path", WRITE)
@pytest.mark.parametrize(
    "origin", ["", "null", "http://example.org", "http://127.0.0.1:1", "https://127.0.0.1:{port}"]
)
def test_other_web_pages_may_not_write(server: ReviewServer, path: str, origin: str) -> None:
    before = server.ask("/api/state").json()["revision"]
    body = {"action": {"do": "accept", "finding": "1"}, "who": "Eve", "revision": before}
    assert server.ask(path, "POST", body, origin=origin.format(port=server.port)).code == 403
    assert server.ask("/api/state").json()["revision"] == before


def test_a_wrong_token_sets_no_cookie_and_the_right_one_opens_the_page(server: ReviewServer) -> None:
    wrong = server.ask("/?token=" + "x" * len(server.token), cookie="")
    assert (wrong.code, "set-cookie" in wrong.headers) == (403, False)
    right = server.ask(f"//example.org/?token={server.token}", cookie="")
    assert (right.code, right.headers["location"]) == (303, "/")
    assert {"HttpOnly", "SameSite=strict"} <= set(right.headers["set-cookie"].split("; "))


@pytest.mark.parametrize("how", [{"transfer_encoding": "chunked"}, {"content_length": str(1 << 30)}])
def test_request_bodies_of_excessive_length_are_not_read(server: ReviewServer, how: dict[str, str]) -> None:
    headers = {k.replace("_", "-"): v for k, v in how.items()}
    assert server.ask("/api/actions", "POST", b"", **headers).code in (411, 413)


ESCAPES = ("../secret.txt", "..%2fsecret.txt", "%2e%2e/secret.txt", "%2e%2e%2fsecret.txt", "..%5csecret.txt",
           "....//secret.txt", "..%252fsecret.txt", "{parent}/secret.txt", "%2f{parent}/secret.txt",
           "..%00/secret.txt", "../run.json", "../../../pyproject.toml")  # fmt: skip


@pytest.mark.parametrize("escape", ESCAPES)
@pytest.mark.parametrize(
    "route",
    ["/{}", "/assets/{}", "/api/frames/{}", "/api/frames/{}.jpg", "/api/tiles/{}", "/api/tiles/photo/0/0/{}",
     "/api/tiles/{}/0/0/0.png", "/api/papers/{}", "/api/papers/report.pdf/{}"],
)  # fmt: skip
def test_no_path_leads_out_of_the_folder(server: ReviewServer, route: str, escape: str) -> None:
    answer = server.ask(route.format(escape.format(parent=server.run.parent)))
    assert answer.code in (400, 404, 422)
    assert SECRET.encode() not in answer.body
    assert b"[project]" not in answer.body


@pytest.mark.parametrize("name", ["model.glb", "run.json", "defects.json", "diagnosis.html", "unrolled.png"])
def test_symbolic_links_out_of_a_run_are_refused(run: Path, tmp_path: Path, name: str) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns(".boresight", "*.zarr"))
    (tmp_path / "run" / name).unlink(missing_ok=True)
    (tmp_path / "run" / name).symlink_to(run.parent / "secret.txt")
    with pytest.raises(InputError, match="link out of the run"):
        RunFiles(tmp_path / "run").file(name)


def test_a_model_that_is_a_symbolic_link_is_not_served(server: ReviewServer) -> None:
    model = server.run / "model.glb"
    kept = model.rename(model.with_suffix(".kept"))
    model.symlink_to(server.run.parent / "secret.txt")
    try:
        answer = server.ask("/api/model/0.glb")
    finally:
        model.unlink()
        kept.rename(model)
    assert answer.code != 200
    assert SECRET.encode() not in answer.body


@pytest.mark.parametrize("path", [*READ, "/nowhere", "/api/papers/nothing", "/api/papers/report.html"])
def test_every_answer_has_the_content_security_policy(server: ReviewServer, path: str) -> None:
    answer = server.ask(path)
    assert {k: answer.headers[k] for k in HEADERS} == HEADERS
    rules = dict(r.strip().split(" ", 1) for r in answer.headers["content-security-policy"].split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == "'self'"
    allowed = {source for rule in rules.values() for source in rule.split()}
    assert allowed <= {"'none'", "'self'", "data:", "blob:"}, "nothing from elsewhere, nothing inline"
    assert (
        server.ask(path, cookie="").headers["content-security-policy"] == HEADERS["content-security-policy"]
    )


@pytest.mark.parametrize(
    "body",
    [
        b"", b"[]", b"{", b"null", b"\xff\xfe", b'{"action":{"do":"drop"},"who":"a","revision":0}',
        b'{"action":{"do":"accept","finding":"../1"},"who":"a","revision":0}',
        b'{"action":{"do":"accept","finding":"1","more":1},"who":"a","revision":0}',
        b'{"action":{"do":"accept","finding":"1"},"who":" ","revision":0}',
        b'{"action":{"do":"accept","finding":"1"},"who":"a\\nb","revision":0}',
        b'{"action":{"do":"accept","finding":"1"},"who":"a","revision":-1}',
        b'{"action":{"do":"redraw","finding":"1","outline":[[0,0],[1,1],[NaN,1]]},"who":"a","revision":0}',
        b'{"action":{"do":"redraw","finding":"1","outline":[[0,0],[1e300,1],[1,1]]},"who":"a","revision":0}',
        b'{"action":{"do":"accept","finding":"99"},"who":"a","revision":0}',
        b"[" * 100_000,
    ],
)  # fmt: skip
def test_broken_requests_change_nothing(server: ReviewServer, body: bytes) -> None:
    before = server.ask("/api/state").json()["revision"]
    answer = server.ask("/api/actions", "POST", body.replace(b'"revision":0', b'"revision":%d' % before))
    assert answer.code == 422
    assert answer.json()["error"]
    assert server.ask("/api/state").json()["revision"] == before


@pytest.mark.parametrize(
    "query", ["distance=nan", "distance=inf", "distance=1e400", "distance=", "", "distance=<b>"]
)
def test_numbers_outside_their_range_are_refused(server: ReviewServer, query: str) -> None:
    assert server.ask(f"/api/section?{query}").code == 422


def test_markup_is_shown_as_text_in_every_paper(server: ReviewServer) -> None:
    revision = server.ask("/api/state").json()["revision"]
    for action in (
        {"do": "comment", "finding": "2", "text": HOSTILE},
        {"do": "accept", "finding": "1"},
        {"do": "reject", "finding": "3", "reason": "=1+1"},
    ):
        answer = server.act(revision, who=HOSTILE, **action)
        assert answer.code == 200
        revision = answer.json()["revision"]
    html = server.ask("/api/papers/report.html").body.decode()
    assert "&lt;script&gt;" in html
    assert "<script" not in html
    assert "<img src=x" not in html
    rows = server.ask("/api/papers/findings.csv").body.decode("utf-8-sig")
    assert "'=1+1" in rows
    assert ",=" not in rows
    assert server.ask("/api/papers/report.pdf").body.startswith(b"%PDF-")
