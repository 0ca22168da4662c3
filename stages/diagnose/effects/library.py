"""All effects whose mark on positions or readings is predicted, by name."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

from pipeline.physics.catalogue import effect
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.camera import CAMERA_MODELS
from stages.diagnose.effects.laser import LASER_MODELS
from stages.diagnose.effects.pose import POSE_MODELS

LIBRARY: Mapping[str, EffectModel] = MappingProxyType(
    {model.name: model for model in (*LASER_MODELS, *CAMERA_MODELS, *POSE_MODELS)}
)


def without(names: Collection[str]) -> Mapping[str, EffectModel]:
    """Return the library less some effects, as for the test of effects it does not know.

    Raises
    ------
    InputError
        When a name is not in the catalogue.
    """
    left_out = {effect(name).name for name in names}
    return MappingProxyType({name: model for name, model in LIBRARY.items() if name not in left_out})
