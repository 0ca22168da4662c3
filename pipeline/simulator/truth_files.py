"""The truth of a rendered recording as files, in a folder of their own."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from pipeline.simulator.scene import Scene, write_scene
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.base import Wall
from pipeline.simulator.wall.description import Defect, Pipe, Weld
from pipeline.simulator.wall.fiducials import markers_of

_JPEG_QUALITY = 95
_JPEG_LARGEST = 65000
_PIXELS_AT_A_TIME = 1024
Json = dict[str, object]


def write_truth(scene: Scene, truth: SceneTruth, premises: Sequence[Json], folder: Path) -> None:
    """Write truth.json, truth_wall.npz, truth_albedo.jpg and the scene itself.

    Parameters
    ----------
    scene, truth
    premises : sequence of mappings
        What was checked, with figures: see `pipeline.simulator.premises`.
    folder : Path
        Made when it is not there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    extent = write_albedo(truth.wall, folder / "truth_albedo.jpg")
    np.savez_compressed(
        folder / "truth_wall.npz",
        distance_mm=truth.wall.shape.distance_mm.astype(np.float32),
        azimuth_rad=truth.wall.shape.azimuth_rad.astype(np.float32),
        radius_mm=truth.wall.radius_mm,
    )
    document: Json = {
        "effects": effects_of(scene),
        "defects": defects_of(scene.pipe),
        "pipe": pipe_of(scene),
        "probe": instrument_of(truth),
        "premises": list(premises),
        "albedo_extent": extent,
        "camera_pose_in_pipe": np.round(truth.poses()[:, :3], 6).tolist(),
    }
    (folder / "truth.json").write_text(json.dumps(document, ensure_ascii=False) + "\n", "utf-8")
    write_scene(scene, folder / "truth_scene.yaml")


def effects_of(scene: Scene) -> list[list[object]]:
    """Return the effects that are switched on: name and quantities in the catalogue's order."""
    from pipeline.simulator.effects.switch import switches_from_mapping

    return [s.truth for s in switches_from_mapping(scene.effects, "scene")]


def defects_of(pipe: Pipe) -> list[Json]:
    """Return defects and welds; depths are positive, their kind tells whether inward or into the wall."""
    return [_defect(d) for d in pipe.defects] + [_weld(w) for w in pipe.welds]


def pipe_of(scene: Scene) -> Json:
    """Return the pipe's shape: radius, sections of bore, ovality, bend, all angles in rad but fiducials'."""
    pipe = scene.pipe
    bend = pipe.bends[0] if pipe.bends else None
    return {
        "radius": pipe.diameter_mm / 2,
        "length": pipe.to_mm - pipe.from_mm,
        "z_min": pipe.from_mm,
        "sections": _sections(pipe),
        "ovality": [pipe.ovality.amplitude_mm, float(np.radians(pipe.ovality.direction_deg))],
        "bend": [bend.curvature_per_mm, float(np.radians(bend.direction_deg))] if bend else [0.0, 0.0],
        "gauge": scene.kind == "gauge",
        "fiducials": [
            [m.id, m.distance_mm, m.azimuth_deg, pipe.fiducials.size_mm] for m in markers_of(pipe.fiducials)
        ] if pipe.fiducials else [],
    }  # fmt: skip


def instrument_of(truth: SceneTruth) -> Json:
    """Return the true camera's and laser's parameters by name, without what effects add beyond the models."""
    camera, laser = truth.instrument.camera.model, truth.instrument.laser
    return {
        "camera": dict(zip(camera.parameter_names, camera.parameters.tolist(), strict=True)),
        "laser": dict(zip(laser.sheet.PARAMETER_NAMES, laser.sheet.parameters.tolist(), strict=True)),
        "line_sigma_mm": laser.profile.sigma_mm,
    }


def write_albedo(wall: Wall, file: Path) -> Json:
    """Write the linear albedo as a picture, rows along the distance, and return its extents."""
    grid, albedo = wall.texture, wall.albedo_bgr
    every = -(-max(grid.rows, grid.columns) // _JPEG_LARGEST)
    picture = np.empty((grid.rows // every, grid.columns // every, 3), np.uint8)
    for first in range(0, len(picture), _PIXELS_AT_A_TIME):
        rows = slice(first, min(first + _PIXELS_AT_A_TIME, len(picture)))
        part = albedo[rows.start * every : rows.stop * every, : picture.shape[1] * every]
        shape = (rows.stop - rows.start, every, picture.shape[1], every, 3)
        picture[rows] = np.clip(np.rint(part.reshape(shape).mean((1, 3)) * 255), 0, 255)
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    file.write_bytes(data.tobytes())
    first_edge = grid.distance_from_mm - grid.step_mm / 2
    last_edge = first_edge + len(picture) * every * grid.step_mm
    return {"distance_mm": [first_edge, last_edge], "azimuth_rad": [-np.pi, np.pi]}


def _sections(pipe: Pipe) -> list[list[float]]:
    """Return [from, to, radius] of each bore, the first reaching back and the last on."""
    if not pipe.bore:
        return []
    edges = np.cumsum([b.length_mm for b in pipe.bore])[:-1].tolist()
    ends = zip([pipe.from_mm, *edges], [*edges, pipe.to_mm], pipe.bore, strict=True)
    return [[a, b, bore.diameter_mm / 2] for a, b, bore in ends]


def _defect(defect: Defect) -> Json:
    return {
        "kind": defect.kind,
        "z": defect.distance_mm,
        "azimuth_deg": defect.azimuth_deg,
        "length": defect.length_mm,
        "width": defect.width_mm,
        "depth": defect.depth_mm,
        "angle": float(np.radians(defect.angle_deg)),
    }


def _weld(weld: Weld) -> Json:
    return {
        "kind": "weld",
        "z": weld.distance_mm,
        "azimuth_deg": 0.0,
        "length": weld.width_mm,
        "width": 0.0,
        "depth": weld.height_mm,
        "angle": 0.0,
    }
