"""An LED that may be dim throughout a recording, although the wall's photo was made in its light.

The run's own photo is darker where the dim LED shone: frames are foretold as dark as they are, and nothing
differs around the picture. But an LED sends every polar angle another share of the light: of a near ring of
wall one side is dark, far ahead all sides are, a little. The same wall is photographed once and seen at many
polar angles as the probe goes on, which shows that. Lamps that lean, a lens or a bore that is no circle make
first and second harmonics around the picture, which are granted at every polar angle.

This bears no name out, though: of an LED's light no more than a thousandth is narrower than these harmonics,
and dirt on the window, shade or a third harmonic make as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from pipeline.adjustment.robust import left_out_sd
from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.twin import Mismatch
from stages.twin.cells import centred, half_turn
from stages.twin.compare import BLOCK_PX
from stages.twin.laws import LED_AZIMUTHS
from stages.twin.locate import FALSE_ALARM
from stages.twin.reference import BlockSamples
from stages.twin.scene import Scene
from stages.twin.switched import share_at

_LEAST, _SURE = 0.25, 3.0
"""Least loss that is said to be one perhaps, chosen; σ."""
_MOST_BLOCKS = 100_000
"""Blocks that patterns are fitted to, about: 50 columns of them take 40 MB, of 12 MP 2 GB."""
_PARTS, _FEWEST_FRAMES = 6, 6
"""Parts of the frames of which each is left out once for a σ; fewest lit frames."""
_FALLOFF_RAD, _HARMONIC_RAD = 0.1, 0.3
"""Steps of polar angle between which falloff, and harmonics around the picture, are taken as straight."""
_AS_DARK, _ALIKE = 0.999, 1e-6
"""Of an LED's share that is taken for all of it: its logarithm stays finite. Relative size of columns that
say what others do."""


def seen_from(samples: BlockSamples, scene: Scene) -> tuple[Float32, Float32]:
    """Return the polar angles and image azimuths (N,), rad, of the middles of blocks."""
    rows, columns = (BLOCK_PX * (a.max() + 1) for a in (samples.row, samples.column))
    middle = (slice(BLOCK_PX // 2, rows, BLOCK_PX), slice(BLOCK_PX // 2, columns, BLOCK_PX))
    theta, phi = (np.nan_to_num(a[middle])[samples.row, samples.column] for a in scene.polar[:2])
    return theta, phi


def dead_led(samples: BlockSamples | None, scene: Scene) -> tuple[Mismatch, ...]:
    """Return the LED that all frames may be without, if the same wall at several polar angles looks like it.

    It cannot be told from other patterns that stand still in the picture, and is no finding: it has no size.
    """
    if samples is None or len(samples.number) < _FEWEST_FRAMES:
        return ()
    few = _thinned(samples)
    angles, step = seen_from(few, scene), 2 * np.pi / LED_AZIMUTHS
    wide, narrow = (_Beside.harmonics(few, *angles, k) for k in (1, 2))
    law = max(
        (_law_at(few, scene, angles, k * step) for k in range(LED_AZIMUTHS)),
        key=lambda one: wide.fall(one.log_light),
    )
    lost, (alone, sd) = law.lost(wide.size(law.log_light)[0]), narrow.size(law.log_light)
    chance = LED_AZIMUTHS * float(2 * t.sf(alone / max(sd, 1e-9), _PARTS - 1))
    if chance > FALSE_ALARM or min(lost, alone) < max(_LEAST, _SURE * sd):
        return ()
    where, nan = half_turn(float(np.degrees(law.azimuth_rad))), float("nan")
    said = (
        f"Wall near the lamps is too dark about image azimuth {where:.0f}°, held against the same wall seen "
        "farther ahead, as if an LED there were dim in all frames: this cannot be told from dirt or shade on "
        "the window, nor from other patterns that stand still in the picture. What to do: look at the LEDs."
    )
    look = scene.ring.at(int(samples.number[0]), law.azimuth_rad)
    return (Mismatch("led_dead", "intensity", "image", (), (), min(chance, 1.0), nan, nan, said, look),)


def _thinned(samples: BlockSamples) -> BlockSamples:
    """Return all views of some cells of the wall, drawn at random, so many that blocks are few."""
    wall = samples.orders["wall"]
    drawn = np.random.default_rng(1).random(wall.max() + 1)
    return samples.kept(drawn[wall] < _MOST_BLOCKS / len(wall))


@dataclass(frozen=True)
class _Law:
    """Logarithm (N,) of the light of blocks without an LED over that of their photo, and its azimuth.

    ``most`` is the largest share of the light that it has in any block.
    """

    log_light: Float
    azimuth_rad: float
    most: float

    def lost(self, size: float) -> float:
        """Return which share of its light the LED has lost, for a size of the logarithm."""
        return float((1 - (1 - _AS_DARK * self.most) ** max(size, 0.0)) / self.most)


def _law_at(samples: BlockSamples, scene: Scene, angles: tuple[Float32, Float32], azimuth_rad: float) -> _Law:
    share = share_at(scene, azimuth_rad, *angles).astype(float)
    log_light = centred(np.log1p(-_AS_DARK * share), samples.orders["wall"], samples.frame)
    return _Law(log_light, azimuth_rad, float(share.max()))


@dataclass(frozen=True)
class _Beside:
    """Brightness (N,) of blocks, and columns (N, K), orthonormal, of what is granted beside a law.

    Frames (N,) are counted from 0.
    """

    bright: Float
    granted: Float
    frame: Int

    @classmethod
    def harmonics(cls, samples: BlockSamples, theta_rad: Float32, phi_rad: Float32, most: int) -> _Beside:
        """Grant light to any power, any falloff over polar angle, and harmonics that change with it."""
        groups = samples.orders["wall"], samples.frame
        theta, phi = (np.asarray(a, float) for a in (theta_rad, phi_rad))
        waves = [f(m * phi) for m in range(1, most + 1) for f in (np.cos, np.sin)]
        columns = [samples.log_light, *_hats(theta, _FALLOFF_RAD)]
        columns += [hat * wave for hat in _hats(theta, _HARMONIC_RAD) for wave in waves]
        own = np.stack([centred(c, *groups) for c in columns], 1)
        left, size, _ = np.linalg.svd(own, full_matrices=False)
        return cls(centred(samples.log_change, *groups), left[:, size > _ALIKE * size[0]], samples.frame)

    def _beyond(self, values: Float) -> Float:
        return np.asarray(values - self.granted @ (self.granted.T @ values))

    def products(self, law: Float) -> Float:
        """Return of each frame (F, 2) the sums of law times brightness, and of its square."""
        law, frames = self._beyond(law), int(self.frame.max()) + 1
        bright = self._beyond(self.bright)
        return np.stack([np.bincount(self.frame, law * a, frames) for a in (bright, law)], 1)

    def fall(self, law: Float) -> float:
        """Return by how much squares of brightness fall with a law, less than 0 with one of other sign."""
        cross, own = self.products(law).sum(0)
        return float(cross * abs(cross) / max(own, 1e-12))

    def size(self, law: Float) -> tuple[float, float]:
        """Return the size of a law and its 1 σ, parts of the frames left out in turns."""
        each = self.products(law)
        parts = np.arange(len(each)) * _PARTS // len(each)
        sums = np.stack([np.bincount(parts, each[:, k], _PARTS) for k in (0, 1)], 1)
        without = sums.sum(0) - sums
        size, *others = (a[0] / max(a[1], 1e-12) for a in (sums.sum(0), *without))
        return float(size), float(left_out_sd(np.array(others)))


def _hats(angle_rad: Float, step_rad: float) -> list[Float]:
    """Return hat functions (N,) of polar angles over all that are there."""
    knots = np.arange(float(angle_rad.min()), float(angle_rad.max()) + step_rad, step_rad)
    return [np.maximum(0.0, 1 - np.abs(angle_rad - k) / step_rad) for k in knots]
