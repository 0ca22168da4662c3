"""The model's pane.

It turns to the chosen place, marks findings, distances and ends, and shows true colours.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.review_browser import Tab
from tests.same_view import side_by_side

_SPOT_ON_SCREEN = """(([s, a]) => {
  const m = boresight.model;
  boresight.session.moveTo([s, a]);
  m.eye.camera.updateMatrixWorld();
  const p = m.spot.marker.position.clone().project(m.eye.camera);
  return [p.x, p.y, p.z]; })"""


def marks(page: Tab, kind: str) -> list[str]:
    return page.js(
        f"[...document.querySelectorAll('.mark{kind}')].filter((e) => !e.hidden).map((e) => e.textContent)"
    )


@pytest.mark.parametrize("hour", [12, 3, 6, 9, 1.5])
def test_the_view_turns_to_a_place_at_any_clock_position(page: Tab, hour: float) -> None:
    azimuth = np.radians(30 * (hour - 3))
    x, y, depth = page.js(f"{_SPOT_ON_SCREEN}([60, {azimuth}])")
    assert max(abs(x), abs(y)) < 0.3
    assert depth < 1, "the place lies in front of the camera"


def test_findings_are_numbered_and_distances_are_labelled(page: Tab) -> None:
    for name in page.standing():
        page.choose(name)
        page.until(
            f"document.querySelector('.mark.finding.chosen:not([hidden])')?.dataset.finding === '{name}'"
        )
    page.page.click("text=Home")
    page.until("document.querySelectorAll('.mark.hour:not([hidden])').length > 0")
    distances = "[...document.querySelectorAll('.mark:not(.hour, .finding, .end):not([hidden])')]"
    page.until(f"{distances}.some((e) => e.textContent.endsWith(' mm'))")
    page.js("boresight.model.fly(1e4)")
    page.until("document.querySelector('.mark.end:not([hidden])')")
    last = page.js("boresight.session.run.distance_mm[1]")
    assert page.js("boresight.model.eye.flown") < last, "the camera stays within the wall"
    assert page.js("boresight.model.scene.background.getHexString()") == "46525e", (
        "no empty space beyond the end is shown"
    )
    (said,) = marks(page, ".end")
    assert float(said.removeprefix("end of the measured wall, ").split()[0]) == pytest.approx(last, abs=0.6)
    page.js("boresight.session.select('1')")
    page.until(
        "/^\\d+ mm at the spot$/.test(document.querySelector('.scale-bar:not([hidden]) span')?.textContent)"
    )
    px = page.page.locator(".scale-bar i").bounding_box()["width"]
    mm = float(page.page.locator(".scale-bar span").inner_text().split()[0])
    eye, high = page.js(
        "(({eye: {camera}, spot: {marker}, canvas}) =>"
        " [camera.position.distanceTo(marker.position), canvas.clientHeight])(boresight.model)"
    )
    fov = np.radians(page.js("boresight.model.eye.camera.fov"))
    assert px / mm == pytest.approx(high / 2 / np.tan(fov / 2) / (1000 * eye), rel=0.05)


def test_from_outside_the_pipe_fills_the_pane(page: Tab) -> None:
    page.page.click("text=Outside")
    corners = page.js("""(() => {
      const { pipe, eye: { camera } } = boresight.model, { distance_mm, radius_mm } = boresight.session.run;
      camera.updateMatrixWorld();
      const turn = [...Array(24).keys()];
      return distance_mm.flatMap((s) => turn.map((k) => {
        const [x, y, z] = pipe.point(s, k * Math.PI / 12, radius_mm);
        const at = camera.position.clone().set(x / 1e3, -y / 1e3, -z / 1e3);
        return at.project(camera).toArray(); })); })()""")
    reach = np.abs(np.array(corners)[:, :2]).max()
    assert 0.8 < reach <= 1, "all of the pipe is seen, and it is large"
    page.page.click("text=Inside")


_OUTLINE_DRAWN = """(async () => {
  const m = boresight.model, { pipe, renderer, eye: { camera } } = m, gl = renderer.getContext();
  const around = 1.015 * boresight.session.run.radius_mm;
  m.marks.thin(false);
  renderer.render(m.scene, camera);
  const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight], px = new Uint8Array(4 * w * h);
  gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, px);
  const seen = (x, y) => {
    for (let dx = -1; dx <= 1; dx++) for (let dy = -1; dy <= 1; dy++) {
      const k = 4 * ((y + dy) * w + x + dx);
      if (px[k] > 200 && px[k + 1] < 130 && px[k + 2] > 150) return true;
    }
    return false;
  };
  const { outline } = boresight.session.finding, out = [];
  outline.forEach(([s, a], k) => {
    const [s1, a1] = outline[(k + 1) % outline.length];
    for (let t = 0; t < 1; t += 0.1) {
      const [x, y, z] = pipe.point(s + t * (s1 - s), a + t * (a1 - a), around);
      const p = camera.position.clone().set(x / 1e3, -y / 1e3, -z / 1e3).project(camera);
      out.push(seen(Math.round((p.x + 1) / 2 * w), Math.round((p.y + 1) / 2 * h)));
    }
  });
  return out; })()"""


@pytest.mark.parametrize(("layer", "askew_rad"), [("photo", 0.0), ("photo", 1.0), ("uncertainty", 0.0)])
def test_outlines_have_no_gaps_when_seen_from_outside(page: Tab, layer: str, askew_rad: float) -> None:
    """At 1 rad the dent is seen at a grazing angle, near the visible edge of the pipe."""
    page.page.select_option("select[aria-label='what the model shows']", layer)
    page.until(f"boresight.model.parts.every((p) => p.mesh.material.name.startsWith('{layer} '))")
    dent = next(f for f in page.standing() if page.finding(f)["kind"] == "dent")
    page.choose(dent)
    page.page.click("text=Outside")
    page.js(f"""(({{ eye: {{ camera }}, controls }}) => {{
      const along = camera.up.clone().set(0, 0, 1), {{ target }} = controls;
      camera.position.sub(target).applyAxisAngle(along, {askew_rad}).add(target);
      controls.update(); }})(boresight.model)""")
    page.js("(boresight.model.spot.group.visible = false, 1)")
    drawn = page.js(_OUTLINE_DRAWN)
    page.js("(boresight.model.marks.group.visible = false, 1)")
    bare = page.js(_OUTLINE_DRAWN)
    page.js("(boresight.model.marks.group.visible = true, 1)")
    page.js("(boresight.model.spot.group.visible = true, boresight.session.show('photo'), 1)")
    page.page.click("text=Inside")
    assert np.mean(drawn) > 0.97
    assert np.mean(bare) < 0.1, "the colours below are not mistaken for the outline's"


@pytest.mark.parametrize("hour", [12, 3, 6, 9, 4.5])
def test_from_outside_the_chosen_place_is_on_the_visible_side(page: Tab, hour: float) -> None:
    page.page.click("text=Outside")
    azimuth = np.radians(30 * (hour - 3))
    x, y, _ = page.js(f"{_SPOT_ON_SCREEN}([60, {azimuth}])")
    assert max(abs(x), abs(y)) < 0.9
    facing = page.js(f"""(() => {{ const {{ pipe, eye: {{ camera }}, spot: {{ marker }} }} = boresight.model;
      const at = pipe.point(60, {azimuth}, 1), axis = pipe.at(60).origin;
      const away = camera.position.clone().sub(marker.position);
      return away.x * (at[0] - axis[0]) - away.y * (at[1] - axis[1]) - away.z * (at[2] - axis[2]); }})()""")
    page.page.click("text=Inside")
    assert facing > 0, "not hidden behind the pipe"


def test_the_model_can_be_shown_alone_and_the_other_views_come_back(page: Tab) -> None:
    before = page.page.locator(".model .stage").bounding_box()
    page.page.click("text=Maximise")
    after = page.page.locator(".model .stage").bounding_box()
    assert after["width"] * after["height"] > 2 * before["width"] * before["height"]
    assert page.page.locator(".foot .hint").is_visible()
    page.page.click("text=Restore")
    assert page.page.locator(".model .stage").bounding_box() == before


def test_captions_fit_on_a_screen_of_720_lines(page: Tab) -> None:
    page.page.locator(".foot .hint").wait_for(state="visible")
    for pane in ("#view-frame .told", "#view-section .told", "#view-flat .status"):
        box = page.page.locator(pane).bounding_box()
        assert box["y"] + box["height"] <= 720


def test_the_photo_is_shown_as_it_was_recorded(page: Tab) -> None:
    """The viewer adds no light to the photo; raking light is added on request, and shows the dent."""
    kind = "boresight.model.parts.map((p) => p.mesh.material.type)"
    dent = next(f for f in page.standing() if page.finding(f)["kind"] == "dent")
    page.choose(dent)
    assert set(page.js(kind)) == {"MeshBasicMaterial"}
    contrast = """(() => {
      const m = boresight.model, gl = m.renderer.getContext();
      const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
      const [maps, seen] = [m.parts.map((p) => p.mesh.material.map), []];
      for (const part of m.parts) { part.mesh.material.map = null; part.mesh.material.needsUpdate = true; }
      m.marks.group.visible = m.spot.marker.visible = false;
      m.shine(); m.renderer.render(m.scene, m.eye.camera);
      const px = new Uint8Array(4 * w * h);
      gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, px);
      for (let y = Math.round(h * .43); y < h * .57; y += 2)
        for (let x = Math.round(w * .43); x < w * .57; x += 2) seen.push(px[4 * (y * w + x)]);
      m.parts.forEach((p, k) => { p.mesh.material.map = maps[k]; p.mesh.material.needsUpdate = true; });
      m.marks.group.visible = m.spot.marker.visible = true;
      seen.sort((a, b) => a - b);
      return (seen[Math.floor(.98 * seen.length)] - seen[Math.floor(.02 * seen.length)]) / 255; })()"""
    assert page.js(contrast) < 0.02
    page.page.check("#raking")
    assert page.js(contrast) > 0.25, "light and shadow show a dent of 1.6 mm"
    page.page.uncheck("#raking")


def test_a_recorded_frame_and_the_model_look_the_same_from_the_same_place(page: Tab) -> None:
    first, last = page.js("boresight.session.run.distance_mm")
    spot = [(first + last) / 2, 0.3]
    sights = page.js(f"boresight.session.source.sights(...{spot})")
    lit = next(s["frame"] for s in sights if s["illumination"] == "led")
    alike = side_by_side(page, lit, *spot)
    assert alike.compared > 0.8
    assert alike.psnr_db > 35, "at least 30 are demanded"
    assert alike.brighter == pytest.approx(1, abs=0.02)
    evenly = side_by_side(page, lit, *spot, is_evenly_lit=True)
    assert evenly.psnr_db < 30, "control: without the light of the frame the pictures differ"
    page.page.check("#alike")
    page.until("boresight.session.stand !== null && document.querySelector('.shots img').naturalWidth > 0")
    page.page.focus(".model canvas")
    page.keys("w")
    assert page.js("boresight.session.stand") is None, "after flying on the view can be turned freely again"
    assert not page.page.is_checked("#alike")


def test_colours_show_the_whole_range_of_values_and_can_be_fixed(page: Tab) -> None:
    page.js("boresight.session.show('deviation')")
    overlay = page.js("boresight.session.overlay()")
    low, high = page.js("boresight.session.limits()")
    assert low <= overlay["full_mm"][0] <= overlay["full_mm"][1] <= high == -low
    page.js("boresight.session.show('misalignment')")
    assert page.js("boresight.session.limits()")[1] >= 0.25, (
        "deviations of some hundredths get no alarming colour"
    )
    page.js("boresight.session.show('deviation')")
    page.page.click("#view-model .legend >> text=Set limits")
    page.page.fill("#view-model [aria-label='value of the first colour']", "-0.5")
    page.page.fill("#view-model [aria-label='value of the last colour']", "0.5")
    page.keys("Enter")
    for pane in ("#view-model", "#view-flat"):
        assert "0.50 inward" in page.page.locator(f"{pane} .legend").inner_text()
    page.until("[...boresight.flat.picture.tiles.keys()].some((t) => t.endsWith('low=-0.5&high=0.5'))")
    page.until("boresight.model.parts.every((p) => p.mesh.material.name === 'deviation -0.5 0.5')")
    page.page.click("#view-model .legend >> text=Full range")
    page.js("boresight.session.show('photo')")


def test_wall_loss_is_a_layer_in_percent(page: Tab) -> None:
    option = page.page.locator("select[aria-label='what the model shows'] option[value=wall_loss]")
    assert option.get_attribute("disabled") is not None
    with page.one_change():
        page.js("void boresight.session.act({do: 'assume', wall_thickness_mm: 5, yield_mpa: null})")
    page.page.select_option("select[aria-label='what the model shows']", "wall_loss")
    assert "% of the wall" in page.page.locator("#view-model .legend").inner_text()
    high = page.js("boresight.session.limits()[1]")
    assert f"{100 * high / 5:.2f} %" in page.page.locator("#view-flat .legend").inner_text()
    page.until("boresight.model.parts.every((p) => p.mesh.material.name.startsWith('wall_loss 0'))")
    page.js("boresight.session.show('photo')")


def test_the_slower_the_machine_the_less_is_drawn_while_the_view_moves(page: Tab) -> None:
    """A picture that took a second is not a rest.

    What is requested directly after it is still part of the movement.
    """
    told = page.js("""(() => {
      const { pace } = boresight.model, own = pace.sharpen, told = [];
      pace.sharpen = (...how) => told.push(how);
      for (const [asked, drawn] of [[0, 1], [2, 1001], [9001, 9002]]) {
        pace.ask(1e6 + asked);
        pace.step(1e6 + drawn);
      }
      pace.sharpen = own;
      return told; })()""")
    assert len(told) == 1, "the first picture and the one after a rest are drawn completely"
    ((sharpness, is_moving),) = told
    assert is_moving
    assert sharpness <= 0.6
