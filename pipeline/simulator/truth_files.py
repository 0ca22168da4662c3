"""The truth of a rendered recording as files, and the seal over them.

A seal lists hashes of the truth in the recording, so that nobody can change the truth before it is opened.
Each hash is SHA-256 over a random nonce and the file, so that a truth cannot be found by trying likely ones.
The nonce stays with the truth.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import yaml

from pipeline.errors import InputError
from pipeline.files.json_yaml import read_yaml
from pipeline.simulator.scene import Scene, write_scene
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.albedo import markers_of
from pipeline.simulator.wall.description import Defect, Pipe, Weld
from pipeline.simulator.wall.grid import Wall

# JPEG quality of the stored albedo, which is for people, not for computing.
_JPEG_QUALITY = 95
# A JPEG has at most 65535 px a side.
_JPEG_LARGEST = 65000
# Rows written at a time, to limit memory.
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
    """Return defects and welds; depths are positive, and the kind says whether inward or into the wall."""
    return [_defect(d) for d in pipe.defects] + [_weld(w) for w in pipe.welds]


def pipe_of(scene: Scene) -> Json:
    """Return the pipe's shape: radius, sections of bore, ovality, bend.

    Angles in rad except those of fiducials.
    """
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
    """Return [from, to, radius] of each bore; the first and the last extend without limit."""
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


SEAL_FILE = "sealed.yaml"
NONCE_FILE = "nonce.txt"
# Version of the seal's format.
_FORMAT = 1
# Bytes hashed at a time.
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Comparison:
    """Whether a file is what was sealed: ``problem`` is empty when it is."""

    file: str
    problem: str


def seal_truth(truth: Path, recording: Path) -> None:
    """Seal the files of a truth folder: hashes into the recording, the nonce into the truth.

    The recording's own files are hashed too, into the same seal, because the truth belongs to them only.
    """
    nonce = secrets.token_hex(32)
    (truth / NONCE_FILE).write_text(nonce + "\n", "utf-8")
    sealed = {
        "format": _FORMAT,
        "method": f"SHA-256 of the text in {NONCE_FILE} followed by the file",
        "truth": {p.name: _hash(p, nonce) for p in _files(truth) if p.name != NONCE_FILE},
        "recording": {p.name: _hash(p, nonce) for p in _files(recording) if p.name != SEAL_FILE},
    }
    (recording / SEAL_FILE).write_text(yaml.safe_dump(sealed, sort_keys=False), "utf-8")


def open_seal(recording: Path, truth: Path) -> tuple[Comparison, ...]:
    """Return for every sealed file, and every file that was not sealed, whether it is unchanged.

    Raises
    ------
    InputError
        When there is no seal, no nonce to check it with, or a file cannot be read.
    """
    try:
        return _opened(recording, truth)
    except (OSError, UnicodeDecodeError) as error:
        file = error.filename if isinstance(error, OSError) else truth / NONCE_FILE
        raise InputError(
            Path(file or recording), f"cannot be read: {error}", expected="a sealed file that may be read",
            hint="correct its permissions, or copy recording and truth again completely",
        ) from error  # fmt: skip


def _opened(recording: Path, truth: Path) -> tuple[Comparison, ...]:
    seal = read_yaml(recording / SEAL_FILE)
    if seal.integer("format", least=1) != _FORMAT:
        raise seal.fail("format", "is of another version", str(_FORMAT))
    nonce = _nonce(truth)
    parts = ((truth, "truth", NONCE_FILE), (recording, "recording", SEAL_FILE))
    return tuple(
        compared
        for folder, key, apart in parts
        for compared in _compared(folder, key, seal.section(key).values, nonce, apart)
    )


def _compared(
    folder: Path, key: str, sealed: Mapping[str, object], nonce: str, apart: str
) -> list[Comparison]:
    there = {p.name for p in _files(folder)} - {apart}
    found = []
    for name in sorted(there | set(sealed)):
        if name not in there:
            problem = "is sealed but not there"
        elif name not in sealed:
            problem = "is there but was not sealed"
        else:
            problem = "" if _hash(folder / name, nonce) == sealed[name] else "is not what was sealed"
        found.append(Comparison(f"{key}/{name}", problem))
    return found


def _nonce(truth: Path) -> str:
    file = truth / NONCE_FILE
    if not file.is_file():
        raise InputError(
            file, "is missing, and without it no hash can be checked",
            hint="give the folder that simulate --seal wrote the truth to",
        )  # fmt: skip
    return file.read_text("utf-8").strip()


def _hash(path: Path, nonce: str) -> str:
    total = hashlib.sha256(nonce.encode())
    with path.open("rb") as stream:
        while chunk := stream.read(_CHUNK):
            total.update(chunk)
    return total.hexdigest()


def _files(folder: Path) -> list[Path]:
    """Return the files that lie directly in a folder, sorted by name; sub-folders are ignored."""
    return sorted(p for p in folder.iterdir() if p.is_file())
