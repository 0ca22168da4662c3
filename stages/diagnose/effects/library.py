"""All effects whose influence on positions or readings can be predicted, by name."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

from pipeline.physics.catalogue import EFFECTS, effect
from pipeline.physics.effect import Channel
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.camera import CAMERA_MODELS
from stages.diagnose.effects.laser import LASER_MODELS, PHOTOMETRIC_MODELS
from stages.diagnose.effects.pose import POSE_MODELS
from stages.diagnose.effects.window import WINDOW_MODELS

_MODELS = (*LASER_MODELS, *CAMERA_MODELS, *WINDOW_MODELS, *POSE_MODELS, *PHOTOMETRIC_MODELS)
LIBRARY: Mapping[str, EffectModel] = MappingProxyType({model.name: model for model in _MODELS})

# Effects of the catalogue whose influence on positions cannot be predicted, and why.
NOT_PREDICTED: Mapping[str, str] = MappingProxyType({
    "slope_bias": "needs the wall's slope and gloss everywhere: told by the profile's skewness and glints",
    "ghost_ring": "a second peak, which a profile shows; its pull on the line depends on the estimator",
    "tube_ghost": "a second peak, which a profile shows; its pull on the line depends on the estimator",
    "speckle": "random: it is the noise floor",
    "saturation": "shifts only a skewed profile, by its skewness: told by the flat top of the profile",
    "gamma": "shifts only a skewed profile, by its skewness: told by the width of the profile",
    "ambient_light": "needs the stray light's slope at every point: told by the profile's floor",
    "fixed_pattern": "random from pixel to pixel: told by stacking residuals in the sensor's frame",
    "dust": "takes light away from a stretch of the ring: told by the line's brightness",
})  # fmt: skip


def without(names: Collection[str]) -> Mapping[str, EffectModel]:
    """Return the library less some effects, as for the test of effects it does not know.

    Raises
    ------
    InputError
        When a name is not in the catalogue.
    """
    left_out = {effect(name).name for name in names}
    return MappingProxyType({name: model for name, model in LIBRARY.items() if name not in left_out})


def shown_in(channels: Collection[Channel], library: Mapping[str, EffectModel]) -> Mapping[str, EffectModel]:
    """Return the effects that show first in one of the channels.

    Those of the profile move rings just as others do (a skewed line as a longer baseline, light from within
    the wall as a glass tube), so that positions alone cannot name them.
    """
    return MappingProxyType({n: model for n, model in library.items() if EFFECTS[n].channel in channels})
