"""Flat pictures of a pipe far longer than the page is wide."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from pipeline.artefacts.measured import WallTexture
from pipeline.export.pictures import write_unrolled
from pipeline.export.report.pictures import TOP_RAD, Window, photo, seen_through

ROWS, COLUMNS = 40000, 48


@pytest.fixture(scope="module")
def long_photo() -> WallTexture:
    """Return a photo that grows brighter along the pipe, with fine stripes that average out, and a gap."""
    s = np.arange(ROWS)
    bgra = np.full((ROWS, COLUMNS, 4), 255, np.uint8)
    bgra[..., :3] = np.rint(60 + 120 * s / ROWS + 10 * (s % 2))[:, None, None]
    bgra[20000:24000, :, 3] = 0
    return WallTexture(bgra, 0.0, 0.5, -np.pi, 2 * np.pi / COLUMNS)


def test_each_pixel_shows_the_mean_of_its_texels(long_photo: WallTexture) -> None:
    window = Window(0.0, 0.5 * ROWS, TOP_RAD, TOP_RAD + 2 * np.pi, 200, 60)
    shown = seen_through(photo(long_photo), window).astype(float)
    assert shown.shape == (60, 200, 3)
    s = (np.arange(200) + 0.5) * ROWS / 200
    level = np.rint(60 + 120 * s / ROWS + 5).astype(np.uint8)
    wanted = level.astype(float)
    away = (s < 19500) | (s > 24500)
    assert np.abs(shown[:, away, 0] - wanted[away]).max() < 8
    assert np.all(shown[:, (s > 20500) & (s < 23500)] == 235), "blank where there is no photo"


def test_a_close_view_shows_every_row(long_photo: WallTexture) -> None:
    window = Window(100.0, 120.0, TOP_RAD, TOP_RAD + 2 * np.pi, 160, 48)
    shown = seen_through(photo(long_photo), window)
    assert np.ptp(shown[24, :, 0].astype(int)) > 5, "the stripes are visible"


def test_sheets_contain_every_row_and_are_labelled_with_their_place(
    long_photo, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr("pipeline.export.pictures._MOST_ROWS", 16000)
    write_unrolled(long_photo, tmp_path)
    place = json.loads((tmp_path / "unrolled.json").read_text())
    assert len(place["sheets"]) == 3
    parts = [cv2.imread(str(tmp_path / s["file"]), cv2.IMREAD_UNCHANGED) for s in place["sheets"]]
    assert np.array_equal(np.concatenate(parts), long_photo.bgra)
    assert [s["distance_from_mm"] for s in place["sheets"]] == [0.0, 8000.0, 16000.0]
    shrunk = cv2.imread(str(tmp_path / "unrolled.png"), cv2.IMREAD_UNCHANGED)
    assert len(shrunk) <= 16000
    assert place["mm_per_px"] * len(shrunk) == pytest.approx(0.5 * ROWS, rel=1e-3)
    assert place["distance_from_mm"] == pytest.approx(0.5)
