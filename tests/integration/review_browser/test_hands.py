"""Touch and pen: they can do on model and wall what a mouse can."""

from __future__ import annotations

import pytest

from tests.review_browser import Tab, tab


class Fingers:
    """Sends touches to a page, as a screen reports them."""

    def __init__(self, page: Tab) -> None:
        self._send = page.page.context.new_cdp_session(page.page).send

    def slide(self, *ways: tuple[tuple[float, float], tuple[float, float]], steps: int = 6) -> None:
        """Move one finger along each path, from its first point to its last, all at once."""
        self._touch("touchStart", [way[0] for way in ways])
        for k in range(1, steps + 1):
            at = [[a + (b - a) * k / steps for a, b in zip(*way, strict=True)] for way in ways]
            self._touch("touchMove", at)
        self._touch("touchEnd", [])

    def _touch(self, kind: str, points: list) -> None:
        touches = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        self._send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})


class Pen:
    """Sends the events of a pen to a page."""

    def __init__(self, page: Tab) -> None:
        self._send = page.page.context.new_cdp_session(page.page).send

    def slide(self, start: tuple[float, float], end: tuple[float, float], steps: int = 6) -> None:
        self._at("mouseMoved", *start, 0)
        self._at("mousePressed", *start, 1)
        for k in range(1, steps + 1):
            at = (a + (b - a) * k / steps for a, b in zip(start, end, strict=True))
            self._at("mouseMoved", *at, 1)
        self._at("mouseReleased", *end, 0)

    def _at(self, kind: str, x: float, y: float, buttons: int) -> None:
        sent = {"type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1}
        self._send("Input.dispatchMouseEvent", sent | {"pointerType": "pen"})


@pytest.fixture(scope="module")
def screen(browser, server):
    """The page on a touch screen, with an inspector's name."""
    context = browser.new_context(viewport={"width": 1280, "height": 720}, has_touch=True)
    with tab(context, server.origin) as page:
        page.open(server.address, model=True)
        page.named("Ada")
        yield page
    context.close()


def middle(page: Tab, of: str) -> tuple[float, float]:
    box = page.page.locator(of).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_one_finger_looks_around_two_fingers_fly_and_a_tap_chooses_the_place(screen: Tab) -> None:
    fingers, (x, y) = Fingers(screen), middle(screen, ".model canvas")
    screen.page.click("text=Home")
    looked = screen.js("boresight.model.eye.look.yaw")
    fingers.slide(((x, y), (x + 60, y)))
    assert screen.js("boresight.model.eye.look.yaw") != looked
    flown, spot = screen.js("[boresight.model.eye.flown, boresight.session.cursor]")
    fingers.slide(((x - 20, y), (x - 80, y)), ((x + 20, y), (x + 80, y)))
    assert screen.js("boresight.model.eye.flown") > flown + 10
    assert screen.js("boresight.session.cursor") == spot, "two fingers choose no place"
    screen.page.click("text=Home")
    screen.page.touchscreen.tap(x + 130, y)
    screen.until(f"boresight.session.cursor[1] !== {spot[1]}")


def test_one_finger_moves_the_wall_and_two_zoom(screen: Tab) -> None:
    fingers, (x, y) = Fingers(screen), middle(screen, ".flat canvas")
    view = "[boresight.flat.view.distance, boresight.flat.view.mmPerPx]"
    screen.choose(screen.standing()[0])
    distance, scale = screen.js(view)
    fingers.slide(((x, y), (x + 50, y)))
    assert screen.js(view)[0] == pytest.approx(distance - 50 * scale, abs=2 * scale)
    fingers.slide(((x - 20, y), (x - 80, y)), ((x + 20, y), (x + 80, y)))
    assert screen.js(view)[1] < 0.8 * scale


@pytest.mark.parametrize("by", ["finger", "pen"])
def test_finger_and_pen_drag_a_corner_of_an_outline(screen: Tab, by: str) -> None:
    screen.choose(screen.standing()[0])
    screen.js("boresight.session.take('redraw')")
    (s, a), *rest = screen.js("boresight.session.drawn")
    x, y = screen.js(f"[boresight.flat.x({s}), boresight.flat.y({a})]")
    box = screen.page.locator(".flat canvas").bounding_box()
    start, end = (box["x"] + x, box["y"] + y), (box["x"] + x - 20, box["y"] + y - 15)
    if by == "pen":
        Pen(screen).slide(start, end)
    else:
        Fingers(screen).slide((start, end))
    (s2, a2), *rest2 = screen.js("boresight.session.drawn")
    scale = screen.js("boresight.flat.view.mmPerPx")
    assert s2 == pytest.approx(s - 20 * scale, abs=2 * scale)
    assert a2 < a
    assert rest2 == rest, "the other corners keep their places"
    screen.js("boresight.session.take('none')")


def test_a_pen_looks_around(screen: Tab) -> None:
    (x, y), yaw = middle(screen, ".model canvas"), screen.js("boresight.model.eye.look.yaw")
    Pen(screen).slide((x, y), (x + 60, y))
    assert screen.js("boresight.model.eye.look.yaw") != yaw
