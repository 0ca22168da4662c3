"""Every effect of the catalogue as a function from one scene's truth to another, and their combination."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType

import numpy as np

from pipeline.errors import InputError
from pipeline.physics.catalogue import ALL_EFFECTS
from pipeline.physics.effect import CourseKind
from pipeline.simulator.effects import camera, laser_and_window, surroundings
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.instrument import TrueInstrument
from pipeline.simulator.truth import SceneTruth

EffectFunction = Callable[..., SceneTruth]
# Speed is a central difference over ± 1 ms, far below the time between frames.
_STEP_S = 1e-3
_MODULES = (laser_and_window, camera, surroundings)

# Each function takes the truth, then the catalogue's quantities by name.
EFFECT_FUNCTIONS: Mapping[str, EffectFunction] = MappingProxyType(
    {name: next(getattr(m, name) for m in _MODULES if hasattr(m, name)) for name in ALL_EFFECTS}
)


def switch_on(truth: SceneTruth, switches: Sequence[Switch]) -> SceneTruth:
    """Return the truth with effects applied in the order of the catalogue, whatever order they are given in.

    Raises
    ------
    InputError
        When an effect does not fit the scene.
    """
    order = list(ALL_EFFECTS)
    for switch in sorted(switches, key=lambda s: order.index(s.name)):
        if switch.course.kind is CourseKind.CONSTANT:
            truth = EFFECT_FUNCTIONS[switch.name](truth, **switch.quantities)
        else:
            truth = replace(truth, changes=(*truth.changes, Coursed.of(truth, switch)))
    return truth


@dataclass(frozen=True)
class Coursed:
    """An effect on the instrument whose size follows a course; ``scene`` is the truth without the effect."""

    scene: SceneTruth
    switch: Switch

    @classmethod
    def of(cls, scene: SceneTruth, switch: Switch) -> Coursed:
        """Return the change that a switch makes.

        Raises
        ------
        InputError
            When the effect changes anything but camera or laser, so that it has no course.
        """
        after = EFFECT_FUNCTIONS[switch.name](scene, **switch.quantities)
        others = (f.name for f in fields(scene) if f.name != "instrument")
        if any(getattr(after, name) is not getattr(scene, name) for name in others):
            raise InputError(
                switch.key, "cannot change with time", expected="an effect on camera, laser or window"
            )
        return cls(replace(scene, changes=()), switch)

    def __call__(self, instrument: TrueInstrument, time_s: float) -> TrueInstrument:
        """See `pipeline.simulator.truth.Change`."""
        start = float(self.scene.frames.time_s[0])
        before, here, after = self.scene.motion.distance_mm.at(time_s + _STEP_S * np.array([-1.0, 0.0, 1.0]))
        part = self.switch.course.factor(time_s - start, here, (after - before) / (2 * _STEP_S))
        size, *others = self.switch.quantities.items()
        scene = replace(self.scene, instrument=instrument)
        sizes = {size[0]: float(part) * size[1], **dict(others)}
        return EFFECT_FUNCTIONS[self.switch.name](scene, **sizes).instrument
