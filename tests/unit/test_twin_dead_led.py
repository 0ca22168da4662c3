"""An LED that is dim during the whole run, so that the wall's photo contains it.

It is found from wall seen twice.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.instrument.probe import Lighting
from stages.twin import sums
from stages.twin.cells import centred
from stages.twin.compare import BLOCK_PX
from stages.twin.dead_led import _thinned, dead_led
from stages.twin.laws import LED_AZIMUTHS
from stages.twin.picture import WholePictures
from stages.twin.reference import WALL_COLUMNS, BlockSamples
from stages.twin.scene import Ring
from stages.twin.switched import share_at

FRAMES, BLOCKS, RADIUS_MM = 12, (30, 40), 50.0
SHAPE = tuple(n * BLOCK_PX for n in BLOCKS)
RING = Ring((SHAPE[1] / 2, SHAPE[0] / 2), 90.0, RADIUS_MM, 25.0)
V, U = np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array(SHAPE)[:, None, None] / 2 + 0.5
POLAR = (np.hypot(U, V) / 90).astype(np.float32), np.arctan2(V, U).astype(np.float32), np.ones(SHAPE, bool)
LIGHTING = Lighting(leds=8, radius_mm=11.0, z_mm=-1.0)
SCENE = SimpleNamespace(polar=POLAR, ring=RING, probe=SimpleNamespace(lighting=LIGHTING))
AT_DEG = 67.5


def _samples(light):
    """Return blocks of a probe that moves on by 4 mm a frame.

    The photo contains ``light`` of angle and azimuth.
    """
    random, (theta, phi) = np.random.default_rng(3), (a[4::8, 4::8] for a in POLAR[:2])
    seen, cell_mm = (theta > 0.5) & (theta < 1.5), 2 * np.pi * RADIUS_MM / WALL_COLUMNS
    row, column = np.nonzero(seen)
    count = len(row)
    frame = np.repeat(np.arange(FRAMES), count)
    theta, phi, row, column = (np.tile(a, FRAMES) for a in (theta[seen], phi[seen], row, column))
    along = ((RADIUS_MM / np.tan(theta) + 4.0 * frame) / cell_mm).astype(int)
    around = ((phi / (2 * np.pi)) % 1 * WALL_COLUMNS).astype(int) % WALL_COLUMNS
    log = light(theta, phi)
    log = centred(log, along * WALL_COLUMNS + around) + 0.005 * random.standard_normal(len(log))
    nothing = np.zeros(len(log))
    return BlockSamples(
        np.expm1(log), 4 + nothing, 32 + nothing, frame, row, column, along, around, 0.0, cell_mm,
        10 * np.arange(FRAMES), theta, 0.05 * random.standard_normal(len(log)),
    )  # fmt: skip


def _dim(lost):
    def light(theta, phi):
        share = share_at(SCENE, np.radians(AT_DEG), theta.astype(np.float32), phi.astype(np.float32))
        return np.log1p(-0.999 * lost * share.astype(float))

    return light


def _dirt(theta, phi):
    return np.log1p(-0.15 * np.exp(-0.5 * (((theta - 1.0) / 0.25) ** 2 + ((phi - 1.0) / 0.5) ** 2)))


@pytest.mark.parametrize(
    "light",
    [
        _dim(1.0),
        _dim(0.6),
        lambda theta, phi: _dim(0.6)(theta, phi) + 0.02 * np.cos(2 * (phi - np.radians(AT_DEG))) / theta,
        _dirt,
        lambda theta, phi: 0.05 * np.cos(3 * phi) * (theta - 1),
    ],
)
def test_what_looks_like_a_dim_led_is_never_told_to_be_one_alone(light, monkeypatch):
    """Dirt and an oval bore got this name, at chances of 1e-9 and with sizes off by six σ."""
    monkeypatch.setattr(sums, "uneven_lamps", lambda *_: ())
    monkeypatch.setattr(sums, "separated_from_wall", lambda *_: ((), ()))
    frames = SimpleNamespace(whole=WholePictures(SCENE), _state=SimpleNamespace(lamp=None), _scene=SCENE)
    suspected, dark, untold = sums.Sums._lamps(frames, _samples(light), False)
    assert (suspected, untold) == ((), ())
    assert all("Dirt or shade on the window" in one.statement and not one.parameters for one in dark)
    assert all(one.names == ("led_dead", "uneven_lamps", "window_dirt") for one in dark)


def test_the_place_of_a_possibly_dim_led_is_reported():
    (found,) = dead_led(_samples(_dim(1.0)), SCENE)
    where = float(found.statement.split("image azimuth ")[1].split("°")[0])
    assert where == pytest.approx(AT_DEG, abs=360 / LED_AZIMUTHS)
    assert found.place[0].value == pytest.approx(where, abs=0.5)


def test_confirmed_uneven_lamps_are_reported_beside_a_dim_led(monkeypatch):
    """They, and what the wall's photo contains of them, were dropped."""
    lamps, of_wall = (SimpleNamespace(mismatch=SimpleNamespace(names=("uneven_lamps",))) for _ in range(2))
    monkeypatch.setattr(sums, "uneven_lamps", lambda *_: ())
    monkeypatch.setattr(sums, "separated_from_wall", lambda *_: ((lamps,), (of_wall,)))
    frames = SimpleNamespace(whole=WholePictures(SCENE), _state=SimpleNamespace(lamp=None), _scene=SCENE)
    suspected, dark, untold = sums.Sums._lamps(frames, _samples(_dim(1.0)), False)
    assert suspected == (lamps,)
    assert (len(dark), untold) == (1, (of_wall,))


def test_a_dim_led_is_told_in_light_that_hardly_shows_its_third_harmonic():
    """Six parts agreed within 7 σ, too little for 24 azimuths, though the second harmonic had chosen one.

    It was an LED of eight, dimmed by 82 %, in a rendered recording.
    """
    light = _samples(_dim(0.82))
    noise = 0.012 * np.random.default_rng(7).standard_normal(len(light.change))
    (found,) = dead_led(replace(light, change=light.change + noise), SCENE)
    assert found.place[0].value == pytest.approx(AT_DEG, abs=360 / LED_AZIMUTHS)


def test_noise_is_no_dark_side():
    flat = _samples(lambda theta, phi: 0 * theta)
    for seed in range(14):
        noise = 0.03 * np.random.default_rng(seed).standard_normal(len(flat.change))
        assert dead_led(replace(flat, change=flat.change + noise), SCENE) == ()


def test_for_a_large_camera_no_more_blocks_are_fitted_with_all_views_of_their_wall(monkeypatch):
    monkeypatch.setattr("stages.twin.dead_led._MOST_BLOCKS", 3000)
    whole = _samples(_dim(1.0))
    few = _thinned(whole)
    assert len(few.frame) == pytest.approx(3000, rel=0.1)
    kept = np.isin(whole.orders["wall"], few.orders["wall"])
    assert kept.sum() == len(few.frame)


@pytest.mark.parametrize(
    "light",
    [
        lambda theta, phi: 0 * theta,
        lambda theta, phi: 0.2 * np.cos(phi - 1) / theta,  # lamps that are inclined
        lambda theta, phi: 0.1 * np.cos(2 * phi) / theta,  # a bore that is not round
        lambda theta, phi: -_dim(1.0)(theta, phi),  # an LED that is brighter
        _dim(0.1),
    ],
)
def test_other_errors_are_not_a_dim_led(light):
    assert dead_led(_samples(light), SCENE) == ()


def test_few_frames_give_no_result():
    assert dead_led(None, SCENE) == ()
