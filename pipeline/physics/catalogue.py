"""All known effects by name: those of the diagnosis, and those on pictures alone."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pipeline.errors import InputError
from pipeline.physics.effect import Effect
from pipeline.physics.instrument import CAMERA_EFFECTS, LASER_EFFECTS, WINDOW_EFFECTS
from pipeline.physics.picture import PICTURE_EFFECTS
from pipeline.physics.surroundings import PHOTOMETRIC_EFFECTS, POSE_EFFECTS

EFFECTS: Mapping[str, Effect] = MappingProxyType({
    effect.name: effect
    for effect in (*LASER_EFFECTS, *CAMERA_EFFECTS, *WINDOW_EFFECTS, *POSE_EFFECTS, *PHOTOMETRIC_EFFECTS)
})  # fmt: skip

# These and the effects on pictures alone, which the simulator renders and the twin names.
ALL_EFFECTS: Mapping[str, Effect] = MappingProxyType(
    {**EFFECTS, **{effect.name: effect for effect in PICTURE_EFFECTS}}
)

# Classes of effects that one kind of recording may not tell apart; data/effects/laws.md compares their laws
# with traced rings.
CLASSES: tuple[tuple[str, ...], ...] = (
    ("laser_cone", "focal_scale", "pupil_shift", "dome_axial"),
    ("baseline", "outside_index", "vignetting", "encoder_scale"),
    ("laser_tilt", "principal_point", "sensor_tilt"),
    ("beam_decentre", "dome_lateral"),
    ("sheet_waviness", "pixel_aspect", "ovality"),
    ("baseline_drift", "focal_drift"),
)


def effect(name: str) -> Effect:
    """Return the effect of that name.

    Raises
    ------
    InputError
        When there is none.
    """
    if name not in ALL_EFFECTS:
        raise InputError("effect", f"{name!r} is not known", expected=", ".join(ALL_EFFECTS))
    return ALL_EFFECTS[name]
