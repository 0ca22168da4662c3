"""Photometric effects switched on in own simulations for the twin to find, and the right answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.simulator.scene import SwayScene, WaveScene
from stages.twin.reflectance import LUMA_BGR

_SPREAD = 1.33
"""Largest factor by which a drawn size departs from the usual one.

Chosen so that the effect keeps its character.
"""


@dataclass(frozen=True)
class Case:
    """An effect that is switched on, and the right answer.

    Attributes
    ----------
    effect : str
    numbers : tuple of float
        Its quantities, in the catalogue's order.
    names : tuple of str
        Names of a mismatch that are right.
    size : float or None
        True value of the mismatch's first parameter, over the effect's first quantity.
    place : str
        ``azimuth`` or ``spot``: where the mismatch must lie; empty for effects on the whole picture.
    figure : tuple of (str, function)
        A figure of noise, lamps or lens that shows the effect, and its true value by the first quantity.
    changes : tuple of (path, value)
        Changes of the scene that make the effect visible.
    also : tuple of str
        Names of mismatches that may be reported too, but do not count as the effect.
    seed : int
        Of the scene and its probe.
    """

    effect: str
    numbers: tuple[float, ...]
    names: tuple[str, ...] = ()
    size: float | None = None
    place: str = ""
    figure: tuple[str, Callable[[float], float]] | None = None
    changes: tuple[tuple[str, Any], ...] = ()
    also: tuple[str, ...] = ()
    seed: int = 0

    @property
    def true_size(self) -> float | None:
        """True value of the mismatch's first parameter."""
        return None if self.size is None else self.size * self.numbers[0]

    def size_as(self, found: dict[str, Any]) -> float | None:
        """Return the true value of a mismatch's first parameter.

        A spot on the window that is told as a dim sector of the laser has the sector's size: the share that
        the line loses, mean over the stated width. The spot is Gaussian; its numbers end with its σ, degrees.
        """
        width = next((p["value"] for p in found["place"] if p["name"] == "width_deg"), None)
        if self.true_size is None or self.place != "spot" or width is None:
            return self.true_size
        sigma = self.numbers[2]
        inside = math.erf(width / 2 / (math.sqrt(2) * sigma))
        return self.true_size * math.sqrt(2 * math.pi) * sigma * inside / width

    @property
    def true_figure(self) -> float | None:
        """True value of the figure that shows the effect."""
        return None if self.figure is None else self.figure[1](self.numbers[0])

    def drawn(self, seed: int) -> Case:
        """Return the case with another size and seed, and at another azimuth where it has a place.

        No share is more than 1: such a size is drawn only below the usual one.
        """
        random = np.random.default_rng([seed, *self.effect.encode()])
        first, *others = self.numbers
        size = first * _SPREAD ** random.uniform(-1, 1)
        if self.size == 1.0 and size > 1:
            size = first**2 / size
        if self.place:
            others[0] = float(random.uniform(-180, 180))
        return replace(self, numbers=(float(size), *others), seed=seed)


_OF_COLOUR = float(np.linalg.norm(LUMA_BGR))  # noise of grey over that of each colour
_EXACT = (("codec", "ffv1"),)  # a lossy codec takes fine noise away
_BRIGHT = (("laser.peak", 4.0),)
"""Otherwise a wall returns at most half a grey level of the line, which rounding removes."""
_MIRRORS = (("probe.laser.opening_angle_deg", 168.0), ("pipe.relief.roughness_mm", 0.002))
"""A wall reflects a flat sheet's line onto itself.

That of a cone, 6° forward, lands 10.7 mm ahead. Rough wall blurs that over a dozen pixels, so the wall that
reflects is smooth.
"""
_SHAKEN = (("motion.yaw_deg", SwayScene(waves=(WaveScene(amplitude=1.5, period_s=0.41),))),)
"""The photo is as blurred as frames that all move alike, which shows nothing; and 18 mm/s blur by .4 px."""
CASES = (
    # Lit frames withheld, every eighth of 30 a second, would see a flicker of 3.7 Hz always at the same
    # phase.
    Case("light_flicker", (0.08, 2.3), ("flicker", "laser_flicker")),
    Case("led_dead", (1.0, 60.0), ("led_dead",), 1.0, "azimuth"),
    Case("laser_sector", (0.8, 60.0, 20.0), ("laser_sector",), 1.0, "azimuth"),
    Case("dust", (0.4, 60.0, 4.0), ("window_dirt",), 1.0, "spot"),
    Case("window_scatter", (0.5, -100.0, 6.0), ("window_scatter",), 1.0, "spot"),
    Case("droplet", (1.0, 150.0, 6.0), ("droplet",), None, "spot"),
    Case("saturation", (3.0,), ("saturation",)),
    Case("bloom", (0.3, 6.0), ("bloom",), changes=_BRIGHT, also=("saturation",)),
    Case("gamma", (0.6,), ("response",), figure=("lamp_power", lambda g: g), changes=_EXACT),
    Case(
        "black_level", (12.0,), figure=("black_dn", lambda b: 16 + b * 219 / 255)
    ),  # of luma in limited range
    Case("defocus", (1.8, 0.0), ("defocus",), figure=("lens_blur_px", lambda d: math.hypot(0.7, d))),
    Case("defective_pixels", (2e-4, 0.5), ("defective_pixels",), 2.0, changes=_EXACT),
    Case(
        "read_noise",
        (60.0,),
        figure=("read_dn", lambda e: math.hypot(15.0, e) * _OF_COLOUR * 255 / 10000),
        changes=_EXACT,
    ),
    Case("full_well", (3000.0,), figure=("gain_e_per_dn", lambda e: e / 255 / _OF_COLOUR**2), changes=_EXACT),
    Case("fixed_pattern", (0.03,), figure=("gain_pattern", lambda g: g), changes=_EXACT),
    Case("dark_pattern", (0.02,), figure=("dark_pattern_dn", lambda d: 255 * d), changes=_EXACT),
    Case(
        "interreflection", (1.0,), ("interreflection", "ambient_light"), changes=_BRIGHT, also=("saturation",)
    ),
    Case("ambient_light", (0.2,), ("ambient_light", "interreflection")),
    Case("ghost_ring", (0.1,), ("second_line",), changes=_MIRRORS),
    Case("motion_blur", (0.02,), ("motion_blur",), changes=_SHAKEN),
)
