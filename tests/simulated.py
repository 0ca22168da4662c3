"""Shipped scenes made small enough to render in a test: fewer pixels, fewer frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.simulator.produce import Order, Places, produce
from pipeline.simulator.scene import Scene, read_scene, scene_from
from tests.shared_data import PROJECT_ROOT

SCENES = PROJECT_ROOT / "configs" / "scenes"


def shipped(name: str) -> Scene:
    return read_scene(SCENES / f"{name}.yaml")


def smaller(scene: Scene, shrink: int, frames: int, **changes: Any) -> Scene:
    """Return the scene seen by a camera of fewer, larger pixels; the line stays as wide in pixels."""
    values = scene.model_dump(mode="json", exclude_defaults=True)
    camera, unsure = values["probe"]["camera"], values["probe"]["standard_uncertainty"]
    camera["image_size"] = [n // shrink for n in camera["image_size"]]
    camera["focal_px"] = [f / shrink for f in camera["focal_px"]]
    camera["centre_px"] = [(c + 0.5) / shrink - 0.5 for c in camera["centre_px"]]
    unsure["focal_px"], unsure["centre_px"] = unsure["focal_px"] / shrink, unsure["centre_px"] / shrink
    values["probe"]["laser"]["line_sigma_mm"] *= shrink
    values["pipe"] |= {"texel_mm": 0.11 * shrink, "to_mm": min(values["pipe"]["to_mm"], 200.0)}
    return scene_from(values | {"frames": frames} | changes, SCENES / "scene.yaml")


def rendered(scene: Scene, folder: Path, sealed: bool = False) -> tuple[Path, Path]:
    """Return the folders of a rendered recording and of its truth."""
    places = Places(folder / scene.name, folder / "truth" / scene.name, sealed)
    produce([Order(scene, SCENES / "scene.yaml", places)], lambda order, done: None)
    return places.recording, places.truth
