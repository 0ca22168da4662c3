"""The gallery: its numbers are the computed ones, residuals follow the laws, every effect has its section."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pipeline.commands import gallery as command
from pipeline.commands.gallery import gallery_page
from pipeline.physics.catalogue import EFFECTS
from pipeline.simulator.effects.switch import Switch, typical_switch
from pipeline.simulator.gallery import Exhibit, exhibit, likenesses
from pipeline.simulator.gallery.scenes import moment_s, scene_pair
from pipeline.simulator.laws import harmonic
from pipeline.simulator.laws.closed_form import LAWS
from pipeline.simulator.laws.radius import radius_check

SHOWN = ("laser_tilt", "principal_point", "sheet_waviness", "pixel_aspect", "dust")


class _Page(HTMLParser):
    """Collects table rows by the id of their section, and everything that the page would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: dict[str, list[list[str]]] = {}
        self.loaded: list[str] = []
        self._section, self._in_cell = "", False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        known = dict(attrs)
        if tag == "section":
            self._section = known.get("id") or ""
        elif tag == "tr":
            self.rows.setdefault(self._section, []).append([])
        elif tag in ("td", "th"):
            self.rows[self._section][-1].append("")
            self._in_cell = True
        self.loaded += [v for k, v in attrs if k in ("src", "href") and v]

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self._in_cell = False

    def handle_data(self, data: str) -> None:
        if self._in_cell:
            self.rows[self._section][-1][-1] += data.strip()


@pytest.fixture(scope="module")
def exhibits() -> list[Exhibit]:
    return [exhibit(typical_switch(name)) for name in SHOWN]


@pytest.fixture(scope="module")
def page(exhibits: list[Exhibit]) -> str:
    return gallery_page(exhibits, [radius_check(e.switch) for e in exhibits if e.name in LAWS])


def test_every_size_on_the_page_is_the_computed_one(exhibits: list[Exhibit], page: str) -> None:
    rows = _Page(page).rows
    for shown in exhibits:
        sizes = {
            r[0]: r[1:] for r in rows[shown.name] if r and re.fullmatch(r"[234] inch", r[0]) and len(r) == 6
        }
        assert len(sizes) == 3
        for radius, residual in shown.residual.items():
            rms, largest, light, width, skewness = map(float, sizes[f"{2 * radius / 25.4:g} inch"])
            assert rms == pytest.approx(1000 * np.sqrt(np.mean(residual.error_mm**2)), abs=0.051)
            assert largest == pytest.approx(1000 * residual.largest_mm, abs=0.051)
            assert light == pytest.approx(100 * np.sqrt(np.mean(residual.light**2)), abs=0.0051)
            assert width == pytest.approx(np.sqrt(np.mean(residual.width_px**2)), abs=5.1e-5)
            assert skewness == pytest.approx(np.sqrt(np.mean(residual.skewness**2)), abs=5.1e-4)


@pytest.mark.parametrize("name", [n for n in SHOWN if n in LAWS])
def test_a_rendered_residual_follows_the_law(exhibits: list[Exhibit], name: str) -> None:
    shown = next(e for e in exhibits if e.name == name)
    psi, order = shown.azimuth_rad, shown.harmonic
    assert order is not None
    for radius, residual in shown.residual.items():
        wanted = LAWS[name](radius, psi, **shown.switch.quantities)
        # first order: 1.5 % at these sizes
        found = harmonic(psi, residual.error_mm, order)
        assert found == pytest.approx(harmonic(psi, wanted, order), abs=0.02 * np.abs(wanted).max())
    assert shown.exponent == pytest.approx(EFFECTS[name].radial_exponent, abs=0.03)


def test_effects_that_look_the_same_are_named(exhibits: list[Exhibit]) -> None:
    alike = {name: {a.name: a for a in found} for name, found in likenesses(exhibits).items()}
    assert alike["laser_tilt"]["principal_point"].one_bore > 0.999
    # r² against l + r²/l: several bores separate them a little
    assert alike["laser_tilt"]["principal_point"].all_bores < 0.995
    assert alike["laser_tilt"]["off-centre probe"].one_bore > 0.999
    # the oval of the aspect ratio lies at 0°; that of the sheet has a free direction, and is turned to it
    assert alike["pixel_aspect"]["sheet_waviness"].one_bore > 0.999
    assert "laser_tilt" not in alike["pixel_aspect"]
    assert alike["dust"] == {}


def test_the_page_opens_offline(page: str) -> None:
    assert all(address.startswith(("data:", "#")) for address in _Page(page).loaded)
    assert "<script" not in page
    assert "default-src 'none'" in page


def test_the_command_shows_the_whole_catalogue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Switch] = []
    one = exhibit(typical_switch("pixel_aspect"))
    monkeypatch.setattr(command, "exhibit", lambda switch: (asked.append(switch), one)[1])
    monkeypatch.setattr(command, "all_checks", lambda: iter(()))
    command.gallery(tmp_path / "gallery.html")
    assert [s.name for s in asked] == list(EFFECTS)
    asked.clear()
    command.gallery(tmp_path / "gallery.html", ["laser_tilt=0.6@10"])
    assert asked == [Switch("laser_tilt", (0.6, 10.0))]
    assert (tmp_path / "gallery.html").read_text("utf-8").count('id="pixel_aspect"') == 1


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_has_a_scene_in_which_it_changes_something(name: str) -> None:
    switch = typical_switch(name)
    plain, changed = scene_pair(switch, 50.8)
    time = moment_s(switch)
    readings = [scene.encoder() for scene in (plain, changed)]
    assert readings[0] is not None
    assert readings[1] is not None
    differs = (
        plain.instrument_at(time) != changed.instrument_at(time)
        or not np.array_equal(plain.wall.radius_mm, changed.wall.radius_mm)
        or not np.array_equal(plain.wall.axis.R_pa, changed.wall.axis.R_pa)
        or not np.allclose(plain.poses(), changed.poses())
        or plain.wall.gloss != changed.wall.gloss
        or plain.odometer != changed.odometer
    )
    assert differs
