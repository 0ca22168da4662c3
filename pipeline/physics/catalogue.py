"""All known effects by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pipeline.errors import InputError
from pipeline.physics.effect import Effect
from pipeline.physics.instrument import CAMERA_EFFECTS, LASER_EFFECTS, WINDOW_EFFECTS
from pipeline.physics.surroundings import PHOTOMETRIC_EFFECTS, POSE_EFFECTS

EFFECTS: Mapping[str, Effect] = MappingProxyType({
    effect.name: effect
    for effect in (*LASER_EFFECTS, *CAMERA_EFFECTS, *WINDOW_EFFECTS, *POSE_EFFECTS, *PHOTOMETRIC_EFFECTS)
})  # fmt: skip

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
    if name not in EFFECTS:
        raise InputError("effect", f"{name!r} is not known", expected=", ".join(EFFECTS))
    return EFFECTS[name]
