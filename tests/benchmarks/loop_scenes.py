"""Recordings there and back for loop closure: equal welds at equal spacing, natural texture between them."""

from __future__ import annotations

from typing import Any

from pipeline.simulator.scene import Scene, scene_from
from tests.simulated import SCENES, shipped

WELD_SPACING_MM = 250.0
_SHRINK = 2.5
_TURN_S, _VIEW_MM, _BACK_TO_MM = 0.6, 110.0, 60.0
_PLAIN = {"mottle": 0.12, "grain": 0.04, "rust": 0.0, "gloss": 0.1, "seam_deg": None}


def back(length_mm: float) -> Scene:
    """Return a textured pipe at 4 mm a frame.

    The encoder reads 0.1 % too much and slips by 6 mm on the way back.
    """
    slip_s = 1.4 * length_mm / 120.0
    effects = {"encoder_scale": {"relative": 0.001}, "encoder_slip": {"slip_mm": -6.0, "time_s": slip_s}}
    return _scene("back", length_mm, 120.0, effects, {})


def faint(length_mm: float) -> Scene:
    """Return a pipe with little texture at 8 mm a frame, which gives the largest drift."""
    return _scene("faint", length_mm, 240.0, {}, _PLAIN)


def _scene(
    name: str, length_mm: float, speed_mm_s: float, effects: dict[str, Any], surface: dict[str, Any]
) -> Scene:
    values = shipped("welded-4-inch").model_dump(mode="json", exclude_defaults=True)
    _shrink(values)
    one_way_s, back_s = length_mm / speed_mm_s, (length_mm - _BACK_TO_MM) / speed_mm_s
    welds = [
        {"distance_mm": WELD_SPACING_MM * (k + 0.5), "width_mm": 6.0, "height_mm": 0.8}
        for k in range(int(length_mm / WELD_SPACING_MM))
    ]
    values["pipe"] |= {"to_mm": length_mm + _VIEW_MM, "welds": welds, "joints": [], "defects": []}
    values["pipe"]["surface"] |= surface
    values["motion"]["legs"] = [
        {"duration_s": one_way_s, "speed_mm_s": speed_mm_s},
        {"duration_s": _TURN_S, "speed_mm_s": 0.0},
        {"duration_s": one_way_s, "speed_mm_s": -speed_mm_s},
    ]
    sway = [{"amplitude": 8.0, "period_s": 13.0}, {"amplitude": 12.0, "period_s": 71.0}]
    values["motion"]["roll_deg"] = {"waves": sway}
    frames = round((one_way_s + _TURN_S + back_s) * 30)
    return scene_from(values | {"name": name, "effects": effects, "frames": frames}, SCENES / "scene.yaml")


def _shrink(values: dict[str, Any]) -> None:
    """Reduce the camera from 1600 × 1200 to 640 × 480 pixels; the line stays as wide in pixels."""
    camera, unsure = values["probe"]["camera"], values["probe"]["standard_uncertainty"]
    camera["image_size"] = [640, 480]
    camera["focal_px"] = [f / _SHRINK for f in camera["focal_px"]]
    camera["centre_px"] = [(c + 0.5) / _SHRINK - 0.5 for c in camera["centre_px"]]
    unsure["focal_px"], unsure["centre_px"] = (unsure[k] / _SHRINK for k in ("focal_px", "centre_px"))
    values["probe"]["laser"]["line_sigma_mm"] *= _SHRINK
    values["pipe"]["texel_mm"] = 0.28


SCENES_BY_NAME = {"back": back, "faint": faint}
