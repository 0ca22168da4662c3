"""The scenes in which effects are shown: the bench, dressed where an effect needs something to act on."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.recording.base import FrameTable
from pipeline.simulator.effects.catalogue import switch_on
from pipeline.simulator.effects.parts import with_laser
from pipeline.simulator.effects.photometric import line_peak
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.laws.bench import BASELINE_MM, bench_truth
from pipeline.simulator.motion import Motion, Signal, constant
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.base import Wall
from pipeline.simulator.wall.build import build_wall
from pipeline.simulator.wall.description import Pipe

# The smallest square picture in which the ring of a 4 inch pipe fits at 360 px/rad.
SIDE_PX = 880
# The line's peak before blur, full scales.
_PEAK = 0.8
# A vibration of 0.2 mm at 5.3 Hz at its fastest, to the lower right.
_RATE_MM_S = 2 * math.pi * 5.3 * 0.2
_SHAKEN = frozenset({"rolling_shutter", "motion_blur"})
_ROUGH = frozenset({"albedo_bias", "slope_bias"})
_WELD_MM, _WELD_WIDTH_MM = BASELINE_MM - 1.5, 6.0
_COMPANIONS = {
    "ghost_ring": Switch("laser_tilt", (0.6, 40.0)),
    "gamma": Switch("line_skew", (1.0,)),
    "saturation": Switch("line_skew", (1.0,)),
}


def surroundings(name: str) -> str:
    """Return in words what the bench is dressed with to show an effect; empty for the plain bench."""
    if name in _SHAKEN:
        return f"the camera moves at {_RATE_MM_S:.1f} mm/s to the lower right"
    if name in _ROUGH:
        return "mottled wall, the line on the flank of a weld"
    other = _COMPANIONS.get(name)
    return "" if other is None else f"{other.text} in both pictures"


def scene_pair(switch: Switch, radius_mm: float) -> tuple[SceneTruth, SceneTruth]:
    """Return the scene without and with an effect, at the moment when it is largest or typical."""
    base = _exposed(bench_truth(radius_mm, image_size=(SIDE_PX, SIDE_PX)))
    if switch.name in _ROUGH:
        base = replace(base, wall=_rough_wall(radius_mm))
    if switch.name in _SHAKEN:
        base = replace(base, motion=_shaken())
    if switch.name in _COMPANIONS:
        # a ghost lies on the line of a straight sheet; clipping and gamma do not move a symmetric line
        base = switch_on(base, [_COMPANIONS[switch.name]])
    moment = FrameTable(np.zeros(1, int), np.array([moment_s(switch)]), np.array(["laser"]))
    return replace(base, frames=moment), replace(switch_on(base, [switch]), frames=moment)


def moment_s(switch: Switch) -> float:
    """Return the time at which to look: a swing's crest, a drift's time constant, else the start."""
    sizes = switch.quantities
    if "frequency_hz" in sizes:
        return 0.25 / sizes["frequency_hz"]
    return sizes["time_s"] if switch.effect.time == "drift" else 0.0


def _exposed(truth: SceneTruth) -> SceneTruth:
    """Return the scene with the line equally bright in every bore, and not clipped."""
    return with_laser(truth, power_mm=truth.instrument.laser.power_mm * _PEAK / line_peak(truth))


def _shaken() -> Motion:
    share = _RATE_MM_S / math.sqrt(2)
    way = Signal(np.array([-1.0, 1.0]), np.array([-share, share]))
    return Motion(constant(0.0), way, way)


def _rough_wall(radius_mm: float) -> Wall:
    weld = {"distance_mm": _WELD_MM, "width_mm": _WELD_WIDTH_MM, "height_mm": 0.5}
    pipe = Pipe.model_validate(
        {"diameter_mm": 2 * radius_mm, "from_mm": 0.0, "to_mm": 60.0, "welds": (weld,)}
    )
    return build_wall(pipe, 1, Path())
