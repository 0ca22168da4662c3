"""What a twin found on the window is excluded from the photo and rings of the next run."""

import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pipeline.api.dirt import dirt_of
from pipeline.api.run import configuration
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.errors import InputError
from pipeline.geometry.image_places import clear_of
from stages.rings.behind_dirt import set_right
from tests.quiet import quiet_context


def _dirty(tmp_path, fixed_to="image", name="droplet", **parameters):
    figures = {"u_px": 100.0, "v_px": 50.0, "radius_px": 8.0}
    place = {key: {"value": value, "sd": 4.0, "unit": "px"} for key, value in figures.items()}
    sizes = {key: {"value": value, "sd": 0.01} for key, value in parameters.items()}
    response = {"fixed_to": "image", "place": {}, "name": "response", "parameters": {}}
    led = {
        "fixed_to": "image",
        "place": {"azimuth_deg": {"value": 90.0}},
        "name": "led_dead",
        "parameters": {},
    }
    channel = "line" if name == "glint" else "intensity"
    spot = {"fixed_to": fixed_to, "place": place, "name": name, "parameters": sizes, "channel": channel}
    (tmp_path / "twin.json").write_text(json.dumps({"found": [response, led, spot]}), "utf-8")
    return configuration(settings=dirt_of(tmp_path)).tree()


def test_dirt_found_by_a_twin_is_excluded_from_the_photo_but_spots_on_the_wall_are_not(tmp_path):
    settings = _dirty(tmp_path)["texture"]["left_out"]
    np.testing.assert_allclose(settings, [(100.0, 50.0, 12.0)])
    assert not _dirty(tmp_path, "wall")["texture"]["left_out"]
    uv = np.array([[[100.0, 50.0], [111.0, 50.0], [113.0, 50.0]]])
    np.testing.assert_array_equal(clear_of(tuple(settings), uv), [[False, False, True]])


@pytest.mark.parametrize(
    ("name", "parameters", "left_out"),
    [
        ("droplet", {"power": 1.0}, True),
        ("droplet", {"aside": 2.0}, True),
        ("window_dirt", {"share": 0.6}, True),
        ("window_dirt", {"share": 0.1}, False),
        (None, {"share": -1.2}, False),
        ("glint", {"excess": 80.0}, True),
    ],
)
def test_rings_exclude_what_moves_the_line(tmp_path, name, parameters, left_out):
    tree = _dirty(tmp_path, name=name, **parameters)
    assert bool(tree["rings"]["left_out"]) == left_out
    assert tree["texture"]["left_out"]


def _rings(count, drop=None, way_px=1.0, noise_px=0.05):
    """Return rings about (200, 200) whose middle wanders.

    A drop (u, v, radius, power) magnifies what is behind it.
    """
    random, psi = np.random.default_rng(4), np.linspace(-np.pi, np.pi, 360, endpoint=False)
    middle = 200 + way_px * random.standard_normal((count, 1, 2))
    outward = np.stack([np.cos(psi), np.sin(psi)], -1)
    radius = 100 + ((middle - 200) * outward).sum(-1)
    if drop is not None:
        u, v, reach, power = drop
        line = 200 + radius[..., None] * outward - (u, v)
        away = np.hypot(*np.moveaxis(line, -1, 0))
        # Near its middle a drop shows at Δ what is at (1 − p) Δ; the line appears farther out.
        moved = power / (1 - power) / (1 + np.exp(away - reach))
        radius = radius + moved * (line * outward).sum(-1)
    radius = (radius + noise_px * random.standard_normal(radius.shape)).astype(np.float32)
    sigma, valid = np.full_like(radius, 0.05), np.full(radius.shape, RingValidity.VALID, np.uint8)
    width = height = np.ones_like(radius)
    return RingSamples(np.arange(count), psi, np.array([200.0, 200.0]), radius, sigma, width, height, valid)


def _lost(rings, *places):
    """Return which samples a place removes after the correction of rings."""
    set_right(rings, places, quiet_context())
    return rings.validity == RingValidity.OUT_OF_VIEW


def test_rings_have_no_sample_at_window_dirt_if_there_are_too_few_to_decide():
    hidden = _lost(_rings(1, way_px=0.0, noise_px=0.0), (300.0, 200.0, 12.0))
    np.testing.assert_array_equal(np.flatnonzero(hidden[0]), np.arange(174, 187))
    assert not _lost(_rings(1)).any()
    assert not _lost(_rings(1), (200.0, 200.0, 50.0)).any()


def test_a_line_that_a_place_of_the_image_does_not_move_is_measured_there():
    """A drop beside the line, found in blocks of pixels, extended over it: an eighth of the wall was lost."""
    beside, same = (_rings(60, drop=(270.0, 200.0, 14.0, 0.6)) for _ in range(2))
    assert _lost(beside, (270.0, 200.0, 36.0)).mean() < 0.01
    np.testing.assert_array_equal(beside.radius_px, same.radius_px)
    assert _lost(_rings(8), (270.0, 200.0, 36.0)).any(0).sum() > 20


@pytest.mark.parametrize("at_u", [300.0, 290.0, 312.0])
def test_a_line_that_a_drop_moves_or_magnifies_is_excluded(at_u):
    """In the middle of a drop the line is not moved.

    But its displacement, as the depth of a dent, is magnified.
    """
    drop = (at_u, 200.0, 14.0, 0.6)
    rings, clean = _rings(60, drop), _rings(60)
    moved = np.abs(rings.radius_px - clean.radius_px).mean(0) > 0.3
    lost = _lost(rings, (at_u, 200.0, 36.0)).any(0)
    assert moved.sum() >= 5
    assert lost[moved].all()
    assert lost.sum() <= moved.sum() + 24
    assert np.abs(rings.radius_px - clean.radius_px)[:, ~lost].max() < 0.3


def test_a_line_that_the_rim_of_a_drop_moves_equally_in_all_rings_is_corrected():
    rings, clean = _rings(60), _rings(60)
    rings.radius_px[:, 178:183] += np.float32(0.4)
    assert not _lost(rings, (300.0, 200.0, 12.0))[:, 177:184].any()
    np.testing.assert_allclose(rings.radius_px[:, 178:183], clean.radius_px[:, 178:183], atol=0.05)
    np.testing.assert_allclose(rings.sigma_px[:, 178:183], np.hypot(0.4, 0.05), atol=0.05)
    np.testing.assert_array_equal(rings.sigma_px[:, :170], clean.sigma_px[:, :170])


def test_a_line_with_unknown_displacement_is_excluded():
    assert _lost(_rings(60, way_px=0.0), (300.0, 200.0, 12.0)).any(0).sum() >= 13


@pytest.mark.parametrize("usually_at_px", [100, 108])
def test_a_drop_that_few_rings_of_a_long_run_cross_is_examined_in_those_rings(usually_at_px):
    """Only every twentieth ring was examined.

    What others showed through a drop, in a wider chamber, was kept.
    """
    rings, few, through = _rings(2560), slice(1001, 1020), slice(174, 187)
    rings.radius_px[:] += usually_at_px - 100
    rings.radius_px[few] += 15
    clean = rings.radius_px.copy()
    rings.radius_px[few, through] += 6
    _lost(rings, (330.0, 200.0, 25.0))
    assert np.abs(rings.radius_px - clean)[rings.valid].max() < 3


def test_the_search_for_dirt_in_a_long_run_needs_little_memory():
    rings, size = _rings(2000), 2000 * 360 * 2 * 8
    tracemalloc.start()
    try:
        set_right(rings, ((300.0, 200.0, 12.0),), quiet_context())
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < size


def test_excluded_samples_behind_dirt_are_counted():
    rings, told = _rings(60, drop=(300.0, 200.0, 14.0, 0.6)), {}
    context = replace(quiet_context(), report=lambda name, value, unit="": told.update({name: value}))
    set_right(rings, ((300.0, 200.0, 36.0),), context)
    assert told["ring samples left out behind dirt"] == (~rings.valid).sum() > 0


def test_a_groove_that_continues_beside_dirt_is_excluded_behind_it():
    """It was levelled only behind the dirt, and reported as measured."""
    rings = _rings(60)
    rings.radius_px[:, 165:196] += np.float32(0.8)
    kept = ~_lost(rings, (300.0, 200.0, 8.0))
    assert kept[:, 165:175].all()
    assert not kept[:, 176:185].any()


def test_a_folder_without_a_twin_is_refused(tmp_path):
    with pytest.raises(InputError, match="boresight twin"):
        dirt_of(tmp_path)
