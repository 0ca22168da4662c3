"""An LED that is dim throughout, though the wall's photo was made in its light: told by wall seen twice."""

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.instrument.probe import Lighting
from stages.twin.cells import centred
from stages.twin.compare import BLOCK_PX
from stages.twin.dead_led import dead_led
from stages.twin.gate import judged
from stages.twin.locate import full_size
from stages.twin.reference import WALL_COLUMNS, BlockSamples
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.switched import Shown, share_at

FRAMES, BLOCKS, RADIUS_MM = 12, (30, 40), 50.0
SHAPE = tuple(n * BLOCK_PX for n in BLOCKS)
RING = Ring((SHAPE[1] / 2, SHAPE[0] / 2), 90.0, RADIUS_MM, 25.0)
V, U = np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array(SHAPE)[:, None, None] / 2 + 0.5
POLAR = (np.hypot(U, V) / 90).astype(np.float32), np.arctan2(V, U).astype(np.float32), np.ones(SHAPE, bool)
LIGHTING = Lighting(leds=8, radius_mm=11.0, z_mm=-1.0)
SCENE = SimpleNamespace(polar=POLAR, ring=RING, probe=SimpleNamespace(lighting=LIGHTING))
AT_DEG = 67.5


def _samples(light):
    """Blocks of a probe that goes on by 4 mm a frame; the photo holds ``light`` of angle and azimuth."""
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


@pytest.mark.parametrize("lost", [0.6, 1.0])
def test_a_dead_led_is_told_though_the_photo_was_made_in_its_light(lost):
    (found,) = dead_led(_samples(_dim(lost)), SCENE)
    (at,), (size,) = found.mismatch.place, found.mismatch.parameters
    assert found.mismatch.name == "led_dead"
    assert at.value == pytest.approx(AT_DEG, abs=2 * at.sd)
    assert size.value == pytest.approx(lost, abs=2 * size.sd)


@pytest.mark.parametrize(
    "light",
    [
        lambda theta, phi: 0 * theta,
        lambda theta, phi: 0.2 * np.cos(phi - 1) / theta,  # lamps that lean
        lambda theta, phi: 0.1 * np.cos(2 * phi) / theta,  # a bore that is no circle
        lambda theta, phi: -_dim(1.0)(theta, phi),  # an LED that is brighter
        _dim(0.1),
    ],
)
def test_what_is_no_dim_led_is_none(light):
    assert dead_led(_samples(light), SCENE) == ()


def test_few_frames_tell_nothing():
    assert dead_led(None, SCENE) == ()


@pytest.mark.parametrize("lost", [0.0, 1.0])
def test_frames_rendered_again_without_the_led_bear_it_out(lost):
    (found,) = dead_led(_samples(_dim(1.0)), SCENE)
    samples = _samples(_dim(lost))
    level = np.full(SHAPE, 100, np.float32)
    region, unknown = np.full(SHAPE, Region.WALL, np.uint8), np.full(SHAPE, np.nan, np.float32)
    twin = TwinFrame(level, np.full(SHAPE, 4.0, np.float32), region, unknown, unknown)

    def shown(number):
        own, change = samples.number[samples.frame] == number, np.zeros(BLOCKS, np.float32)
        change[samples.row[own], samples.column[own]] = samples.change[own]
        above = level * full_size(1 + change, SHAPE)
        return number, Shown(above, twin, level > 0, SCENE, None, None, np.eye(2), int(number))

    kept, withdrawn = judged([found], lambda frames: map(shown, frames))
    assert (len(kept), len(withdrawn)) == (lost == 1.0, lost == 0.0)
