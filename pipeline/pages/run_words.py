"""What the figures of a run are called for people; files keep the stages' own names."""

from __future__ import annotations

import re
from collections.abc import Callable

STAGES = {
    "premises": "Recording checked", "rings": "Laser line in the frames", "triangulate": "Points of the wall",
    "motion": "Motion of the camera", "accumulate": "Shape of the wall", "texture": "Photo of the wall",
    "overlays": "Colours of the error layers", "mesh": "Surface of the model", "sections": "Cross-sections",
    "defects": "Findings",
}  # fmt: skip
SAMPLE_REASONS = {
    "valid": "used", "no_line": "no laser line there", "low_contrast": "line too faint",
    "saturated": "saturated", "glint": "glint", "ghost": "second reflection",
    "outlier": "off the neighbouring line", "out_of_view": "outside the picture",
    "width": "line of implausible width", "frame_rejected": "its whole frame was rejected",
}  # fmt: skip
"""Why a ring sample is not used, by the name of its `RingValidity` in small letters."""
_LAYERS = {
    "deviation": "deviation from the fitted pipe", "deviation_nominal": "deviation from the nominal diameter",
    "uncertainty": "1 σ of the radius", "misalignment": "radius error if misalignment were ignored",
}  # fmt: skip
_PLAIN: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], str]], ...] = (
    (re.compile(r"^overlay (\w+): range$"), lambda m: f"{_LAYERS.get(m[1], m[1])}: value of the last colour"),
    (re.compile(r"^overlay (\w+): beyond the range$"),
     lambda m: f"{_LAYERS.get(m[1], m[1])}: share beyond the last colour"),
    (re.compile(r"^ring samples rejected: (\w+)$"),
     lambda m: f"ring samples not used: {SAMPLE_REASONS.get(m[1], m[1])}"),
    (re.compile(r"^ring samples valid$"), lambda _: "ring samples used"),
    (re.compile(r"^rejected: "), lambda _: "not used: "),
    (re.compile(r"^mesh: "), lambda _: ""),
    (re.compile(r"\bRMS (.*)"), lambda m: f"{m[1]}, root mean square"),
    (re.compile(r"\b1 sigma\b"), lambda _: "1 σ"),
)  # fmt: skip


def figure_name(name: str) -> str:
    """Return what a figure of a stage or of a run is called on a page."""
    for pattern, plain in _PLAIN:
        name = pattern.sub(plain, name)
    return name


def stage_title(stage: str) -> str:
    """Return what a stage does, in words; of a stage that is not known, its name."""
    return STAGES.get(stage, stage)
