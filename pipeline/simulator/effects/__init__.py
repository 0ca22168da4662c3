"""Every effect of the catalogue as a function from one scene's truth to another; switching several on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from pipeline.physics.catalogue import ALL_EFFECTS
from pipeline.simulator.effects import camera, laser, photometric, picture, pose, window
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.truth import SceneTruth

EffectFunction = Callable[..., SceneTruth]
_FAMILIES = {
    "laser": laser, "camera": camera, "window": window, "pose": pose, "photometric": photometric,
    "picture": picture,
}  # fmt: skip

# Each takes the truth, then the catalogue's quantities by name.
EFFECT_FUNCTIONS: Mapping[str, EffectFunction] = MappingProxyType(
    {name: getattr(_FAMILIES[effect.family], name) for name, effect in ALL_EFFECTS.items()}
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
        truth = EFFECT_FUNCTIONS[switch.name](truth, **switch.quantities)
    return truth
