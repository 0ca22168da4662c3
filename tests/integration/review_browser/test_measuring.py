"""Measuring on wall and model: every tool states its σ."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.review_browser import Tab


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
def test_every_tool_states_its_sigma(page: Tab, tool: str, places: list[Any], names: list[str]) -> None:
    page.show_wall(60, -1.2, 0.3)
    page.page.click(f'.tools button:text-is("{tool}")')
    page.click_wall(*places)
    page.until("document.querySelector('#view-flat .status').textContent.includes('±')")
    said = page.status()
    assert all(f"{name} " in said for name in names)
    assert said.count("±") == len(names)
    if tool == "Distance":
        assert 20 < float(said.split("straight ")[1].split(" ")[0]) < 40
        page.page.click("#view-flat .status >> text=Save")
        with page.page.expect_download() as taken:
            page.page.click("text=1 saved (CSV)")
        rows = Path(taken.value.path()).read_text("utf-8").splitlines()
        assert len(rows) == 1 + len(names)
        assert all(name in row and "50.0" in row for name, row in zip(names, rows[1:], strict=True))
        page.page.click("text=Clear")


def test_the_model_can_be_measured_on(page: Tab) -> None:
    page.page.click('.tools button:text-is("Point")')
    page.page.click("text=Home")
    page.js("boresight.model.eye.flown = 20, boresight.model.fly(0)")
    box = page.page.locator(".model canvas").bounding_box()
    page.page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
    page.until("document.querySelector('#view-flat .status').textContent.includes('±')")
    assert "radius" in page.status()
