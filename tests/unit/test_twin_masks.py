"""What a twin found on the window is kept out of the next run's photo and rings."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.api.dirt import dirt_of
from pipeline.api.run import configuration
from pipeline.artefacts.measured import RingValidity
from pipeline.errors import InputError
from pipeline.geometry.image_places import clear_of
from stages.rings.extract import _outside
from stages.rings.trace import RingTrace


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


def test_dirt_of_a_twin_is_left_out_of_the_photo_and_what_is_on_the_wall_is_not(tmp_path):
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
def test_rings_leave_out_what_moves_the_line(tmp_path, name, parameters, left_out):
    tree = _dirty(tmp_path, name=name, **parameters)
    assert bool(tree["rings"]["left_out"]) == left_out
    assert tree["texture"]["left_out"]


def test_a_ring_has_no_sample_where_the_window_is_dirty():
    psi = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    sectors = SimpleNamespace(azimuth_rad=psi, centre_px=np.array([200.0, 200.0]))
    fit = SimpleNamespace(radius_px=np.full(360, 100.0))
    trace = RingTrace(fit, np.full(360, RingValidity.VALID, np.uint8), 1.2, None)
    validity = _outside(((300.0, 200.0, 12.0),), trace, sectors).validity
    hidden = np.flatnonzero(validity == RingValidity.OUT_OF_VIEW)
    np.testing.assert_array_equal(hidden, np.arange(174, 187))
    assert _outside((), trace, sectors) is trace


def test_a_folder_without_a_twin_is_refused(tmp_path):
    with pytest.raises(InputError, match="boresight twin"):
        dirt_of(tmp_path)
