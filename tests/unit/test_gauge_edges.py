"""Edges of fiducials in pictures: position, its σ, and which edges are left out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.special import erf

from pipeline.arrays import Float, Image
from pipeline.geometry.rigid import inverse, transform
from stages.calibrate.gauge import premises
from stages.calibrate.gauge.edges import detect, detector, fit_steps, measure_edges
from stages.calibrate.gauge.geometry import Gauge, gauge_of
from stages.calibrate.gauge.white import brightest_grey
from tests.gauge_runs import USUAL, facts, stated_probe
from tests.quiet import quiet_context


def test_an_edge_is_found_at_its_place_with_the_stated_sigma() -> None:
    random = np.random.default_rng(3)
    t = np.broadcast_to(np.linspace(-4, 4, 21), (400, 21)).copy()
    place = random.uniform(-1, 1, 400)
    step = 0.5 * (1 + erf((t - place[:, None]) / 0.8 / np.sqrt(2)))
    grey = (20 + 90 * step) * (1 + 0.03 * t) + random.normal(0, 1.0, t.shape)
    found, sigma = fit_steps(t, grey)
    error = (found - place)[np.isfinite(found)]
    assert len(error) > 390
    assert abs(error.mean()) < 4 * error.std() / np.sqrt(len(error))
    # besides noise, σ includes a floor for the effect of blur
    noise = np.sqrt(np.nanmedian(sigma) ** 2 - 0.03**2)
    assert 0.8 < error.std() / noise < 1.25


@pytest.mark.parametrize(("beyond", "white_px"), [(50.0, 3.3), (80.0, 3.0), (50.0, 5.0), (110.0, 3.3)])
def test_a_darker_wall_beyond_a_narrow_white_border_does_not_move_the_edge(beyond, white_px) -> None:
    """Edges of a gauge whose white border was narrower than a cell lay .35 px outside, with σ .07 px."""
    random = np.random.default_rng(4)
    t = np.broadcast_to(np.linspace(-4, 4, 21), (400, 21)).copy()
    place = random.uniform(-0.5, 0.5, 400)[:, None]
    step, end = (0.5 * (1 + erf((t - place - at) / 0.9 / np.sqrt(2))) for at in (0.0, white_px))
    grey = 20 + 90 * step - (110 - beyond) * end + random.normal(0, 1.0, t.shape)
    found, sigma = fit_steps(t, grey)
    assert np.isfinite(found).mean() > 0.9
    assert abs(np.nanmean(found - place[:, 0])) < np.nanmedian(sigma)


def _black_squares(gauge: Gauge, marker: int, T_pc: Float, white: float, brightest: int) -> Image:
    """Return a picture of a fiducial's black square on white wall, blurred and clipped at ``brightest``."""
    camera = stated_probe().camera
    u, v = camera.project(transform(inverse(T_pc), gauge.on_marker(np.array(marker), np.zeros(2)))).uv.astype(
        int
    )
    column, row = np.meshgrid(np.arange(u - 99, u + 99), np.arange(v - 99, v + 99))
    ray = camera.unproject(np.stack([column.ravel(), row.ravel()], -1).astype(float)).ray @ T_pc[:3, :3].T
    near = gauge.fiducials.markers[marker]
    radius = float(gauge.radius_mm[gauge.section(np.array(near.distance_mm))])
    wall = T_pc[:3, 3] + ray * (radius / np.maximum(np.hypot(ray[:, 0], ray[:, 1]), 1e-9))[:, None]
    turn = np.angle(np.exp(1j * (np.arctan2(wall[:, 1], wall[:, 0]) - np.radians(near.azimuth_deg))))
    away = np.maximum(np.abs(turn) * radius, np.abs(wall[:, 2] - near.distance_mm))
    grey = np.where(away < gauge.fiducials.size_mm / 2, 40.0, white).reshape(column.shape)
    image = np.zeros((1200, 1600), np.uint8)
    image[row, column] = np.clip(cv2.GaussianBlur(grey, (0, 0), 1.0), 0, brightest)
    return image


@pytest.mark.parametrize(("white", "brightest"), [(200.0, 235), (450.0, 235), (240.0, 255), (450.0, 255)])
def test_an_edge_beside_overexposed_white_is_left_out_as_it_appears_too_far_inside(
    white: float, brightest: int
) -> None:
    """It lay 0.1 to 0.4 px inside, so that a sound probe's baseline was 7 σ off, without a warning.

    In videos of full range, white of 240 was left out, although it is good there.
    """
    gauge, T_pc = gauge_of(facts(), facts().fiducials), np.eye(4)
    T_pc[2, 3] = -12.0
    image = _black_squares(gauge, 4, T_pc, white, brightest)
    edges, left_out = measure_edges(
        image, 0, np.array([4]), T_pc, stated_probe().camera, gauge, USUAL, brightest
    )
    if white > brightest:
        assert left_out >= 4 * USUAL.edge_samples - 2
        assert not len(edges.uv)
    else:
        where = stated_probe().camera.project(transform(inverse(T_pc), edges.xyz_p)).uv
        outside = np.einsum("mi,mi->m", edges.uv - where, edges.normal)
        assert left_out == 0
        assert len(outside) >= 4 * USUAL.edge_samples - 2
        assert np.abs(outside).mean() < 0.1


@pytest.mark.parametrize(
    ("clipped_at", "brightest", "level"),
    [(235, 500.0, 235), (240, 500.0, 240), (245, 300.0, 245), (255, 500.0, 255), (255, 243.0, 255)],
)
def test_pictures_clipped_below_the_white_of_their_range_are_recognised(
    clipped_at: int, brightest: float, level: int
) -> None:
    """A camera whose white ends at 240 counted as not overexposed, and its edges moved inward."""
    random, along = np.random.default_rng(2), np.linspace(-1.5, 1.5, 300)
    images = [
        np.clip(np.exp(-(along**2)) * brightest + random.normal(0, 1.5, (200, 300)), 0, clipped_at)
        for _ in range(9)
    ]
    grey = [np.clip(i + random.normal(0, 1.0, i.shape), 0, 255).astype(np.uint8) for i in images]
    shown = {"grey": grey, "bgr": [np.repeat(g[..., None], 3, -1) for g in grey]}
    recording = SimpleNamespace(read=lambda frames, kind: [(int(k), shown[kind][k]) for k in frames])
    assert brightest_grey(recording, np.arange(9)) == pytest.approx(level, abs=1)


def test_overexposed_edges_are_reported() -> None:
    said: list[str] = []
    context = replace(quiet_context(), warn=said.append)
    premises.warn_of_overexposed(0, 900, context)
    assert said == []
    premises.warn_of_overexposed(100, 900, context)
    assert "100 of 1000 edges of fiducials are left out" in said[0]


def test_no_edge_is_found_where_there_is_none_or_where_bright_comes_before_dark() -> None:
    t = np.broadcast_to(np.linspace(-4, 4, 21), (2, 21)).copy()
    flat = np.full((1, 21), 60.0) + np.random.default_rng(0).normal(0, 1, (1, 21))
    falling = 60 - 40 * (t[:1] > 0)
    assert np.isnan(fit_steps(t, np.concatenate([flat, falling]))[0]).all()


def test_with_unreadable_frames_white_is_the_end_of_the_range() -> None:
    unread = SimpleNamespace(read=lambda frames, planes: iter((int(n), None) for n in frames))
    assert brightest_grey(unread, np.arange(3)) == 255


@pytest.mark.parametrize("side_px", [20.0, 27.0])
def test_the_corners_of_a_small_fiducial_lie_on_its_border(side_px: float) -> None:
    """They lay on a contour within it; fiducials of 27 px were refused as 5 % smaller than stated."""
    finder, random, sides = detector("DICT_4X4_100"), np.random.default_rng(4), list[float]()
    for number in range(24):
        pattern = cv2.aruco.generateImageMarker(finder.getDictionary(), number, 600) / 255 * 120.0 + 20.0
        sheet = np.pad(np.pad(pattern, 100, constant_values=140.0), 400, constant_values=60.0)
        place = cv2.getRotationMatrix2D((799.5, 799.5), random.uniform(-180, 180), side_px / 600)
        place[:, 2] += random.uniform(64, 65, 2) - 799.5
        fine = cv2.warpAffine(sheet, 8 * place + [[0, 0, 3.5]] * 2, (1024, 1024), borderValue=60.0)
        image = cv2.GaussianBlur(cv2.resize(fine, (128, 128), interpolation=cv2.INTER_AREA), (0, 0), 0.8)
        for corner in detect(finder, image.astype(np.uint8))[1]:
            sides += list(np.linalg.norm(corner - np.roll(corner, 1, 0), axis=1))
    assert len(sides) > 60
    assert np.median(sides) == pytest.approx(side_px, abs=0.5)
