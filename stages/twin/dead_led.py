"""Locate an LED that may have been dim throughout a recording, although the photo was made in its light.

The run's own photo is darker where the dim LED shone: predicted frames are equally dark, and no difference
around the picture remains. But the LED's share of the light depends on the polar angle: a near ring of wall
is dark on one side, far ahead all sides are a little darker. The same wall is in the photo once but is seen
at many polar angles as the probe advances, which shows the difference. Lamps that lean, a lens, or a bore
that is not circular make first and second harmonics around the picture; these are fitted freely at every
polar angle.

This justifies a place and a class: no more than a thousandth of an LED's light is narrower than these
harmonics, and dirt on the window, shade or a third harmonic have effects of the same size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import centred, half_turn
from stages.twin.compare import BLOCK_PX
from stages.twin.laws import LED_AZIMUTHS
from stages.twin.locate import FALSE_ALARM
from stages.twin.reference import BlockSamples
from stages.twin.scene import Scene
from stages.twin.significance import ratio_over_frames
from stages.twin.switched import share_at

_CLASS = "led_dead or uneven_lamps or window_dirt"
_LEAST, _SURE = 0.25, 3.0
"""Smallest loss that is mentioned, chosen; and its significance, σ."""
_LOBE = 0.15
"""Relative 1 σ of an LED's share of the light because its lobe is unknown, as for an LED that fails."""
_MOST_BLOCKS = 100_000
"""Approximate number of blocks in the fit: 50 columns of them take 40 MB, of all blocks of 12 MP 2 GB."""
_PARTS, _FEWEST_FRAMES = 6, 6
"""Number of parts of the frames, each of which is left out once for a σ; least number of lit frames."""
_FALLOFF_RAD, _HARMONIC_RAD = 0.1, 0.3
"""Knot spacing over the polar angle, of the falloff and of the harmonics around the picture."""
_AS_DARK, _ALIKE = 0.999, 1e-6
"""Largest share of the light that an LED may have, so that the logarithm stays finite. Relative size below
which a column is taken to be a combination of others."""


def seen_from(samples: BlockSamples, scene: Scene) -> tuple[Float32, Float32]:
    """Return polar angles and image azimuths (N,), rad, of the middles of blocks."""
    rows, columns = (BLOCK_PX * (a.max() + 1) for a in (samples.row, samples.column))
    middle = (slice(BLOCK_PX // 2, rows, BLOCK_PX), slice(BLOCK_PX // 2, columns, BLOCK_PX))
    theta, phi = (np.nan_to_num(a[middle])[samples.row, samples.column] for a in scene.polar[:2])
    return theta, phi


def dead_led(samples: BlockSamples | None, scene: Scene) -> tuple[Mismatch, ...]:
    """Return the side that is dark in all frames as by a dim LED, if wall seen at several angles shows it.

    It has no size, since other patterns that stay still in the picture look the same. Its azimuth is chosen
    among all by what is wider than the first harmonic; what is narrower than the second must agree.
    """
    if samples is None or len(samples.number) < _FEWEST_FRAMES:
        return ()
    few = _thinned(samples)
    angles, step = seen_from(few, scene), 2 * np.pi / LED_AZIMUTHS
    wide, narrow = (_Beside.harmonics(few, *angles, k) for k in (1, 2))
    laws = [_law_at(few, scene, angles, k * step) for k in range(LED_AZIMUTHS)]
    falls = [wide.fall(one.log_light) for one in laws]
    law, bright = laws[int(np.argmax(falls))], laws[int(np.argmin(falls))]
    if narrow.fall(law.log_light) < -narrow.fall(bright.log_light):
        return ()  # an LED that is too bright has the same second harmonic a quarter turn away
    (size, size_sd), (alone, sd) = (beside.size(law.log_light) for beside in (wide, narrow))
    # Narrower ones take part in the choice: a third harmonic has six azimuths at which chance may agree.
    # Of 124 drawings of noise, 1 and 3 % were 7 and 3.5 times as frequent at the chosen azimuth.
    chance = max(LED_AZIMUTHS * _chance(size, size_sd), 6 * _chance(alone, sd))
    apart = _SURE * float(np.linalg.norm([size_sd, sd, _LOBE * size]))
    if chance > FALSE_ALARM or min(law.lost(size), alone) < max(_LEAST, _SURE * sd) or size - alone > apart:
        return ()
    where, nan = half_turn(float(np.degrees(law.azimuth_rad))), float("nan")
    said = (
        f"Near the lamps the wall is too dark about image azimuth {where:.0f}°, compared with the same "
        "wall seen farther ahead, as if an LED there were dim in all frames. Dirt or shade on the window, or "
        "lamps that shine unevenly in another way, look the same. What to do: check the LEDs, clean the "
        "window, and record again."
    )
    at = NamedFigure("azimuth_deg", where, 180 / LED_AZIMUTHS, "deg")
    look = scene.ring.at(int(samples.number[0]), law.azimuth_rad)
    return (Mismatch(_CLASS, "intensity", "image", (at,), (), min(chance, 1.0), nan, nan, said, look),)


def _chance(size: float, sd: float) -> float:
    """Return the probability that parts of the frames agree so well by chance on a size of either sign."""
    return float(2 * t.sf(abs(size) / max(sd, 1e-9), _PARTS - 1))


def _thinned(samples: BlockSamples) -> BlockSamples:
    """Return all views of randomly drawn cells of the wall, so that about `_MOST_BLOCKS` blocks remain."""
    wall = samples.orders["wall"]
    drawn = np.random.default_rng(1).random(wall.max() + 1)
    return samples.kept(drawn[wall] < _MOST_BLOCKS / len(wall))


@dataclass(frozen=True)
class _Law:
    """Logarithm (N,) of the light of blocks without an LED over that in their photo, and the LED's azimuth.

    ``most`` is the largest share of the light that it has in any block.
    """

    log_light: Float
    azimuth_rad: float
    most: float

    def lost(self, size: float) -> float:
        """Return which share of its light the LED has lost, from a fitted factor on the logarithm."""
        return float((1 - (1 - _AS_DARK * self.most) ** max(size, 0.0)) / self.most)


def _law_at(samples: BlockSamples, scene: Scene, angles: tuple[Float32, Float32], azimuth_rad: float) -> _Law:
    share = share_at(scene, azimuth_rad, *angles).astype(float)
    log_light = centred(np.log1p(-_AS_DARK * share), samples.orders["wall"], samples.frame)
    return _Law(log_light, azimuth_rad, float(share.max()))


@dataclass(frozen=True)
class _Beside:
    """Log brightness (N,) of blocks, and orthonormal columns (N, K) that are fitted beside a law.

    Frames (N,) are counted from 0.
    """

    bright: Float
    granted: Float
    frame: Int

    @classmethod
    def harmonics(cls, samples: BlockSamples, theta_rad: Float32, phi_rad: Float32, most: int) -> _Beside:
        """Fit a power of the light, any falloff over polar angle, and harmonics at every polar angle."""
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
        """Return for each frame (F, 2) the sums of law × brightness and of law²."""
        law, frames = self._beyond(law), int(self.frame.max()) + 1
        bright = self._beyond(self.bright)
        return np.stack([np.bincount(self.frame, law * a, frames) for a in (bright, law)], 1)

    def fall(self, law: Float) -> float:
        """Return by how much squares of brightness fall with a law; negative for the opposite sign."""
        cross, own = self.products(law).sum(0)
        return float(cross * abs(cross) / max(own, 1e-12))

    def size(self, law: Float) -> tuple[float, float]:
        """Return the size of a law and its 1 σ, by leaving out parts of the frames in turn."""
        return ratio_over_frames(self.products(law), _PARTS)


def _hats(angle_rad: Float, step_rad: float) -> list[Float]:
    """Return hat functions (N,) of polar angles, with knots over their whole range."""
    knots = np.arange(float(angle_rad.min()), float(angle_rad.max()) + step_rad, step_rad)
    return [np.maximum(0.0, 1 - np.abs(angle_rad - k) / step_rad) for k in knots]
