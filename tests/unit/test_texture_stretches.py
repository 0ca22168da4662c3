"""A pipe photographed in stretches: the same views, the same picture, and no step at the joints."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import WallTexture
from stages.texture import TextureParameters, photograph_wall, quantile_of_counts
from stages.texture.grid import FlatGrid
from stages.texture.noise import views_against
from stages.texture.photometry import LightChain, cut_plan
from stages.texture.sampling import LightSamples
from stages.texture.surface import wall_surface
from stages.texture.views import TileViews, seen_by, shared
from tests.quiet import quiet_context
from tests.unit.drawn_pipe import draw, poses, recording_of, seen_wall, small_probe, trajectory_of
from tests.unit.test_texture_parts import straight_wall, views_at

FRAMES = 24


@pytest.mark.parametrize("views_at_once", [20, 1500])
def test_stretches_together_give_the_same_picture(views_at_once: int) -> None:
    T = poses(FRAMES)
    images = [draw(small_probe(), t) for t in T]

    def picture(at_once: int) -> WallTexture:
        return photograph_wall(
            recording_of(images, "led"), small_probe(), trajectory_of(T), seen_wall(T),
            TextureParameters(views_at_once=at_once, tile_mm=2.0), quiet_context(),
        )  # fmt: skip

    whole, cut = picture(10000), picture(views_at_once)
    ratio = cut.bgra[..., :3].astype(float) / np.maximum(whole.bgra[..., :3], 1)
    rows = ratio.mean((1, 2)) / np.median(ratio)
    assert np.ptp(rows) < 0.02
    assert np.array_equal(cut.bgra[..., 3], whole.bgra[..., 3])
    assert (views_at_once == 20) == bool(np.any(cut.bgra != whole.bgra)), "control: the pipe was cut"


def test_stretches_cover_all_tiles_and_use_no_more_views_than_allowed() -> None:
    plan = [TileViews(np.arange(k, k + 12), 5.0) for k in range(0, 200, 3)]
    stretches = cut_plan(plan, 30)
    assert [t for s in stretches for t in s.tiles] == list(range(len(plan)))
    for stretch in stretches:
        assert len(stretch.wanted) <= 30
        chosen = np.unique(np.concatenate([plan[t].views for t in stretch.tiles]))
        np.testing.assert_array_equal(stretch.wanted, chosen)
    assert len(stretches) > 3
    assert len(cut_plan(plan, 10000)) == 1


def drawn_light(first: int, last: int, level: float) -> LightSamples:
    """Return samples of a wall of random cells in views ``first`` to ``last``, under one light."""
    wall = np.random.default_rng(4).normal(0, 0.2, (200, 12)) + level
    view, row, column = (g.ravel() for g in np.meshgrid(np.arange(first, last), np.arange(30), np.arange(12)))
    theta = 1.3 - 0.02 * row
    value = wall[view + row, column] - 2.0 * (theta - 1.0) ** 2
    return LightSamples(
        value, theta, -np.pi + 2 * np.pi * column / 12, (view + row) * 12 + column, view - first
    )


def test_the_brightness_is_continuous_from_stretch_to_stretch() -> None:
    chain = LightChain(80, small_probe(), 1.0)
    first = chain.add(drawn_light(0, 45, 0.0), np.arange(45), 1.0)
    second = chain.add(drawn_light(35, 80, 0.0), np.arange(35, 80), 1.0)

    def brightness(light, view: int) -> Float:
        field = light.field
        theta = np.linspace(0.8, 1.25, 9)
        at = field.theta_from + field.theta_step * np.arange(len(field.log_correction))
        return np.log(light.gain[view]) + np.interp(theta, at, field.log_correction.mean(1))

    for view in range(35, 45):
        np.testing.assert_allclose(brightness(second, view), brightness(first, view), atol=0.03)
    assert np.isnan(first.gain[45:]).all()
    assert np.isfinite(chain.gain).all()
    np.testing.assert_array_equal(chain.wanted, np.arange(80))


def plainly_planned(grid: FlatGrid, distance: Float, baseline: float, reach_mm: float):
    """Choose views by a search over all of them for every tile."""
    half = grid.tile_rows * grid.mm_per_px / 2
    for tile in grid.tiles():
        offset = grid.centre_mm(tile) - distance - baseline
        reach = max(reach_mm, np.sort(np.abs(offset))[:3][-1] + half)
        near = np.flatnonzero(np.abs(offset) < reach + half)
        passes = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
        yield max(passes, key=len), reach


@pytest.mark.parametrize("count", [2, 40, 300])
def test_chosen_views_equal_those_of_a_full_search(count: int) -> None:
    random = np.random.default_rng(count)
    distance = np.cumsum(random.normal(0.3, 0.6, count)) - 20  # a little forth and back
    grid = FlatGrid(0.0, 0.5, 240, 640, 24)
    surface, probe = wall_surface(straight_wall(), 0.0, 0.5), small_probe()
    got = seen_by(grid, surface, views_at(distance), probe.laser, 8.0)
    wanted = plainly_planned(grid, distance, probe.laser.baseline_mm, 8.0)
    for chosen, (views, reach) in zip(got, wanted, strict=True):
        np.testing.assert_array_equal(chosen.views, views)
        assert chosen.reach_mm == pytest.approx(reach)


@pytest.mark.parametrize("most", [1, 7, 16, 100])
def test_tiles_have_similar_numbers_of_views_and_share_them(most: int) -> None:
    ends = np.sort(np.random.default_rng(most).integers(0, 400, (40, 2)), axis=1)
    plan = [TileViews(np.arange(a, b), 5.0) for a, b in ends]
    found = shared(plan, most)
    for all_of_tile, kept in zip(plan, found, strict=True):
        assert min(most, len(all_of_tile.views)) - 1 <= len(kept.views) <= most
        assert set(kept.views) <= set(all_of_tile.views)
    alike = shared([TileViews(np.arange(k, k + 60), 5.0) for k in range(0, 140, 20)], 15)
    assert len(np.unique(np.concatenate([t.views for t in alike]))) == 180 // 4
    assert all(14 <= len(t.views) <= 15 for t in alike)


def test_views_average_noise_down_to_that_of_rounding() -> None:
    assert views_against(1.4, 48) == 24
    assert views_against(0.0, 48) == 16
    assert views_against(9.0, 48) == views_against(float("nan"), 48) == 48
    assert views_against(1.4, 10) == 10


def test_a_surface_made_in_blocks_equals_one_made_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = straight_wall(lambda s, psi: 25 + 0.2 * np.sin(s / 3) + 0.1 * np.cos(2 * psi))
    wall.radius_map.radius_mm[5:9, 3:20] = np.nan
    whole = wall_surface(wall, 0.6, 0.8)
    monkeypatch.setattr("stages.texture.surface._BLOCK_ROWS", 11)
    monkeypatch.setattr("stages.texture.surface._MORE_ROWS", 12)
    cut = wall_surface(wall, 0.6, 0.8)
    for name in ("radius_mm", "along", "around"):
        np.testing.assert_allclose(getattr(cut, name), getattr(whole, name), atol=1e-4)


@pytest.mark.parametrize("quantile", [0.0, 0.37, 0.5, 0.9995, 1.0])
def test_quantiles_from_counts_equal_those_of_the_values(quantile: float) -> None:
    values = np.random.default_rng(1).integers(0, 60, 501)
    assert quantile_of_counts(np.bincount(values), quantile) == pytest.approx(np.quantile(values, quantile))
