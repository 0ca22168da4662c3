"""Linked views: wall, model, frame and section move together; overlays, relief, cuts, flight."""

from __future__ import annotations

import json
import re
import time

import numpy as np
import pytest
from playwright.sync_api import Route

from pipeline.pages import notation
from tests.patience import patience
from tests.review_browser import Tab, tab

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


def cursor(page: Tab) -> tuple[float, float]:
    return tuple(page.js("boresight.session.cursor"))


def turned(a: float, b: float) -> float:
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def told(page: Tab, place: str, old: str) -> str:
    """Return the text of a view once it differs from ``old`` and the view is no longer loading."""
    words = f"document.querySelector('{place} .told').textContent"
    page.until(f"{words} !== {json.dumps(old)} && !document.querySelector('{place} [aria-busy]')")
    return page.page.locator(f"{place} .told").inner_text()


def test_a_click_on_the_wall_moves_all_views(page: Tab) -> None:
    page.show_wall(60, -1.5, 0.25)
    frame, section = (page.page.locator(f"{v} .told").inner_text() for v in ("#view-frame", "#view-section"))
    marker = page.js("boresight.model.spot.marker.position.toArray()")
    page.click_wall(SPOT)
    distance, azimuth = cursor(page)
    assert (distance, azimuth) == pytest.approx(SPOT, abs=0.4)
    assert "Frame" in told(page, "#view-frame", frame)
    assert "Radius at" in told(page, "#view-section", section)
    assert page.js("boresight.model.spot.marker.position.toArray()") != marker
    assert page.status().startswith(f"Spot at {distance:.1f} mm, 12:")


def test_a_click_on_the_model_moves_to_what_was_clicked(page: Tab) -> None:
    page.js("boresight.session.moveTo([70, -2.4])")
    x, y = page.js("""(() => {
        const m = boresight.model, box = m.canvas.getBoundingClientRect();
        m.eye.camera.updateMatrixWorld(); const p = m.spot.marker.position.clone().project(m.eye.camera);
        return [(p.x + 1) / 2 * box.width, (1 - p.y) / 2 * box.height]; })()""")
    page.js("boresight.session.moveTo([30, 1.0])")
    page.js("(boresight.model.eye.turnTo(70, -2.4), boresight.model.draw())")
    page.page.locator(".model canvas").click(position={"x": x, "y": y})
    distance, azimuth = cursor(page)
    assert abs(distance - 70) < 1.5
    assert turned(azimuth, -2.4) < 0.03


def test_a_click_on_the_frame_moves_to_what_was_clicked(page: Tab) -> None:
    page.js("boresight.session.moveTo([66, 0.4])")
    page.page.uncheck("#close-up")
    sights = "boresight.session.source.sights(66, 0.4)"
    sought = page.js(f"{sights}.then((all) => all.map((s) => Math.round(s.spot_px[0])).sort().join())")
    circles = "[...document.querySelectorAll('.zoomed circle.spot')]"
    page.until(f"{circles}.map((e) => Math.round(e.getAttribute('cx'))).sort().join() === '{sought}'")
    box = page.page.locator(".zoomed circle.spot").first.bounding_box()
    page.js("boresight.session.cursor = [20, -3]")  # changed directly, so that no view is notified
    page.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.until("boresight.session.cursor[0] !== 20")
    distance, azimuth = cursor(page)
    page.page.check("#close-up")
    assert abs(distance - 66) < 2
    assert turned(azimuth, 0.4) < 0.05


def test_the_lit_frame_is_first_and_the_laser_frame_beside_it(page: Tab) -> None:
    page.js("boresight.session.moveTo([60, -1.2])")
    page.until("document.querySelectorAll('.shots .picture').length === 2")
    lit, laser = page.page.locator(".shots .name").all_inner_texts()
    assert lit.startswith("lit frame")
    assert laser.startswith("laser frame")


def test_what_takes_long_is_shown_as_loading(page: Tab) -> None:
    """The place and the picture of a frame are held back until the page says that it is loading."""
    said = "[...document.querySelectorAll('#view-frame .told, #view-frame .name')].map((e) => e.textContent)"
    frames, view = "/^Loading the recorded frames/", "/^Loading a recorded frame in the model/"
    picture, held = "/^lit frame \\d+, loading…$/", dict[str, Route]()

    def until_said(words: str, asked: str) -> None:
        page.until(f"{said}.some((t) => {words}.test(t))")
        end = time.monotonic() + patience(15)
        while asked not in held and time.monotonic() < end:
            page.page.wait_for_timeout(20)
        held.pop(asked).continue_()

    for asked in ("sights?", "stand?", "seen.png?"):
        page.page.route(re.compile(re.escape(asked)), lambda r, _, asked=asked: held.update({asked: r}))
    try:
        page.js("boresight.session.moveTo([40, 0.8])")
        until_said(frames, "sights?")
        page.until(f"!{said}.some((t) => /loading/i.test(t))")
        page.page.check("#alike")
        for words, asked in ((view, "sights?"), (view, "stand?"), (picture, "seen.png?")):
            until_said(words, asked)
        page.until(f"!{said}.some((t) => /loading/i.test(t))")
    finally:
        page.page.uncheck("#alike")
        page.page.unroute_all(behavior="ignoreErrors")


def test_the_first_view_waits_only_for_data_that_it_shows(context, server) -> None:
    """Frames and the hash of the signature are requested after a part of the model is visible, not before."""
    asked: list[str] = []
    with tab(context, server.origin) as fresh:
        fresh.page.on("request", lambda request: asked.append(request.url.removeprefix(server.origin)))
        fresh.open(server.origin + "/", model=True)
        fresh.until("boresight.session.seal !== null")
        fresh.until("document.querySelector('.shots img')?.naturalWidth > 0")
    first = {name: next(k for k, a in enumerate(asked) if a.startswith(f"/api/{name}"))
             for name in ("run", "state", "model", "model/0", "seal", "sights")}  # fmt: skip
    assert first["model/0"] < min(first["seal"], first["sights"])
    script = asked.index("/assets/page.js")
    assert max(first[name] for name in ("run", "state", "model")) < script + 5, (
        "requested in parallel with the script"
    )


def test_a_click_on_the_section_changes_the_azimuth_only(page: Tab) -> None:
    page.js("boresight.session.moveTo([50, -1.5])")
    box = page.page.locator(".section svg[role=img]").bounding_box()
    page.page.mouse.click(box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2)
    assert cursor(page)[0] == 50
    assert turned(cursor(page)[1], 0) < 0.05


def test_every_overlay_is_shown_on_wall_and_model(page: Tab) -> None:
    names = page.js("boresight.session.run.overlays.map((o) => o.name)")
    assert len(names) >= 5
    names.remove("wall_loss")  # needs a wall thickness: see the test of colours
    for name in [*names, "photo"]:
        page.page.select_option('select[aria-label="what the wall shows"]', name)
        page.until(f"boresight.flat.picture.shown === '{name}'")
        page.until(f"boresight.model.parts.every((p) => p.mesh.material.name.startsWith('{name} '))")
        assert ("mm" in page.page.locator("#view-model .legend").inner_text()) == (name != "photo")


def test_relief_is_exaggerated_relative_to_the_round_pipe(page: Tab) -> None:
    def radii() -> tuple[float, float]:
        return tuple(page.js(_RADII))

    radius = page.js("boresight.session.run.radius_mm")
    plain = np.array(radii()) - radius
    page.page.fill("#gain", "5")
    assert np.array(radii()) - radius == pytest.approx(5 * plain, rel=0.02)
    page.page.fill("#gain", "1")
    assert np.array(radii()) - radius == pytest.approx(plain, abs=1e-3)


def test_the_model_can_be_cut_open_from_outside_only(page: Tab) -> None:
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
    before = page.js(
        "[boresight.model.eye.flown, boresight.model.eye.look.yaw, boresight.model.frameTimes.length]"
    )
    page.keys("w", "w", "Shift+W", "s", "d")
    flown, yaw = page.js("[boresight.model.eye.flown, boresight.model.eye.look.yaw]")
    assert flown - before[0] == pytest.approx(6 + 6 + 30 - 6)
    assert yaw < before[1]
    assert page.standing(), "beside the model, D looks around and adds no defect"
    assert page.js("boresight.session.tool") == "none"


def test_while_the_view_rests_the_model_is_sharp_and_not_drawn_again(page: Tab) -> None:
    page.page.locator(".model canvas").focus()
    for _ in range(12):
        page.keys("w")
    page.page.wait_for_timeout(patience(900))
    drawn = "boresight.model.renderer.info.render.frame"
    before = page.js(drawn)
    page.page.wait_for_timeout(patience(900))
    assert page.js(drawn) == before
    assert page.js("boresight.model.renderer.getPixelRatio() / boresight.model.pixelRatio") == pytest.approx(
        1
    )


def test_the_page_writes_numbers_and_places_as_the_papers_do(page: Tab) -> None:
    """The functions of words.ts agree with those of notation.py: rounding of halves, signs, sizes."""
    values = [0.0, 0.125, -0.375, 0.15, 2.5, 1.0005, 41.25, 41.75, -1.4825, 99.9996, 12345.6, 7 / 24]
    sigmas = [0.0, 4e-5, 0.0125, 0.0285, 0.25, 0.5, 3.2, 25.0, 1500.0]
    hours = [0.0, 0.0083333, 0.5083333, 3.1415, 7.775, 7.0083333, 11.99166667, 11.9999, 12.5]
    asked = {
        "measured": [[v, s, "mm"] for v in values for s in sigmas] + [[None, 0.1, "mm"], [1.5, None, "MPa"]],
        "depth": [[v, s] for v in values for s in sigmas] + [[None, None]],
        "distanceExtent": [[v, v - 0.25, v + 1.35] for v in values] + [[None, 1.25, 2.75]],
        "clockOfHours": [[h] for h in hours],
        "clockExtent": [[h, h + wide] for h in hours for wide in (0.008333333, 0.7, 11.99, 12.0)],
        "moment": [["2026-11-22T18:30:59.123456+00:00"]],
    }
    own = {
        "measured": notation.measured, "depth": notation.depth, "distanceExtent": notation.distance,
        "clockOfHours": notation.clock, "clockExtent": notation.clock_extent, "moment": notation.moment,
    }  # fmt: skip
    for name, cases in asked.items():
        shown = page.js(f"{json.dumps(cases)}.map((c) => boresight.words.{name}(...c))")
        assert shown == [own[name](*case) for case in cases], name
