"""The exponent of brightness over the lamps' light, estimated from blocks of a probe that moves sideways."""

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.artefacts.twin import Mismatch
from stages.twin import sums
from stages.twin.compare import BLOCK_PX
from stages.twin.gate import judged
from stages.twin.lamp_power import lamp_power, power_of_lamps
from stages.twin.locate import full_size
from stages.twin.reference import BlockSamples
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.switched import Shown

FRAMES = 12
RING = Ring((96.0, 64.0), 40.0, 50.0, 20.0)


def _samples(power, photo_wrong=0.0, wandering=0.12, slopes_err=0.0):
    """Return blocks of a wall lit from a probe off the axis; the photo may contain the light's error, too.

    Slopes of the radius map may have errors; then the predicted light has errors that vary from block to
    block.
    """
    random = np.random.default_rng(3)
    frame, row, column = (a.ravel() for a in np.mgrid[0:FRAMES, 0:16, 0:24])
    turn = np.arctan2(row - 8.0, column - 12.0)
    off = wandering * np.stack([np.sin(0.9 * frame), np.cos(1.7 * frame)])
    nearer = off[0] * np.cos(turn) + off[1] * np.sin(turn)
    light = nearer - 0.02 * np.hypot(row - 8, column - 12)  # the second part is learned as the lamps' falloff
    along = row + 3 * frame
    log = (power - 1) * nearer + photo_wrong * np.sin(along) + 0.01 * random.standard_normal(len(frame))
    error = slopes_err * random.standard_normal(len(frame))
    light, log = light + error, log - error  # the twin is as bright as the predicted light
    return BlockSamples(
        np.expm1(log), 4 + 0 * log, 32 + 0 * log, frame, row, column, along, column, 0.0, 2.5,
        10 * np.arange(FRAMES), row / 40, light,
    )  # fmt: skip


@pytest.mark.parametrize(("power", "name"), [(0.45, "response or interreflection"), (1.6, "response")])
def test_a_response_is_found_where_the_wall_gets_brighter_as_lamps_come_nearer(power, name):
    (found,) = power_of_lamps(_samples(power, photo_wrong=0.05), RING)
    (size,) = found.mismatch.parameters
    assert found.mismatch.name == name
    assert size.value == pytest.approx(power, abs=3 * size.sd)
    assert size.sd < 0.05
    assert found.from_other_half(10)[0] == pytest.approx(power, abs=0.1)


@pytest.mark.parametrize("power", [1.0, 0.85])
def test_exact_light_of_the_lamps_or_a_little_reflected_light_is_not_a_response(power):
    assert power_of_lamps(_samples(power), RING) == ()


@pytest.mark.parametrize("power", [1.0, 0.7])
def test_errors_of_the_wall_slopes_do_not_pull_the_exponent(power):
    (figure,) = lamp_power(_samples(power, slopes_err=0.02))
    assert figure.value == pytest.approx(power, abs=0.02)


@pytest.mark.parametrize("raised_by", [1.0, 1.032, 1.052])
def test_sigma_of_the_exponent_includes_the_uncertain_lobe_of_the_lamps(raised_by):
    """LEDs that shine as the cosine raise it by so much; half of that was subtracted for every probe."""
    (figure,) = lamp_power(_samples(raised_by))
    assert abs(figure.value - 1) < 1.5 * figure.sd
    assert figure.value == pytest.approx(raised_by, abs=0.005)


def test_the_reported_exponent_is_the_one_by_which_frames_are_judged():
    (found,) = power_of_lamps(_samples(1.6), RING)
    assert found.size_of(found.sizes.mean(0))[0] == pytest.approx(found.mismatch.parameters[0].value)


@pytest.mark.parametrize("wandering", [0.0, 1e-6])
def test_a_probe_that_does_not_move_sideways_gives_no_result(wandering):
    assert lamp_power(_samples(0.45, wandering=wandering)) == ()


def test_few_frames_give_no_result():
    assert power_of_lamps(None, RING) == ()


def test_frames_rendered_again_with_the_exponent_confirm_it():
    samples = _samples(0.45)
    (found,) = power_of_lamps(samples, RING)
    level = np.full((16 * BLOCK_PX, 24 * BLOCK_PX), 100, np.float32)
    region, unknown = np.full(level.shape, Region.WALL, np.uint8), np.full_like(level, np.nan)
    twin = TwinFrame(level, np.full_like(level, 4.0), region, unknown, unknown)

    def shown(number):
        own = samples.number[samples.frame] == number
        above = level * full_size(1 + samples.change[own].reshape(16, 24).astype(np.float32), level.shape)
        everywhere, even = np.ones(level.shape, bool), np.eye(2)
        return number, Shown(above, twin, everywhere, SimpleNamespace(), None, None, even, int(number))

    kept, withdrawn = judged([found], lambda frames: map(shown, frames))
    assert not withdrawn
    assert kept[0].chi2_after < 0.5 * kept[0].chi2_before


@pytest.mark.parametrize(("clipped", "other_power"), [(False, False), (False, True), (True, True)])
def test_neither_response_nor_uneven_lamps_are_named_where_something_else_looks_the_same(
    clipped, other_power, monkeypatch
):
    """Clipped lit wall was called a response, and with a response lamps were called uneven."""

    def of(name):
        return SimpleNamespace(mismatch=Mismatch(name, "intensity", "image", (), (), 0.0, 2.0, 1.0, "It is."))

    named = {"power_of_lamps": (of("response"),) if other_power else (), "response_of": (), "focus_of": ()}
    for function, told in named.items():
        monkeypatch.setattr(sums, function, lambda *_, told=told: told)
    monkeypatch.setattr(sums, "judged", lambda some, _: (tuple(one.mismatch for one in some), ()))
    frames = SimpleNamespace(
        _scene=SimpleNamespace(ring=None), _state=SimpleNamespace(sharpness=0.0, black_in_photo=False),
        _shown=print, _lamps=lambda *_: ((of("uneven_lamps"),), (), ()),
        whole=SimpleNamespace(suspected=lambda sharpness: ()),
        comparison=SimpleNamespace(wall_is_clipped=clipped),
    )  # fmt: skip
    kept, withdrawn = sums.Sums.named(frames, None, None)
    right = [] if clipped else ["response"] if other_power else ["uneven_lamps"]
    assert [m.name for m in kept] == right
    assert all("cannot be told" in m.statement for m in withdrawn)
    assert len(withdrawn) == clipped + other_power
