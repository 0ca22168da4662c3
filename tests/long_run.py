"""A finished run of any length, made by repeating the results of a real run end to end."""

from __future__ import annotations

import json
import struct
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Float
from pipeline.artefacts.findings import Sections
from pipeline.artefacts.measured import RadiusMap, RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.geometry.axis import PipeAxis
from pipeline.machine.run_folder import RunFolder
from pipeline.machine.store import Provenance
from pipeline.review.run_files import RunFiles

KEY = "0" * 64
STAGES = {"rings": RingSamples, "motion": Trajectory, "accumulate": Wall, "texture": WallTexture,
          "overlays": Overlays, "sections": Sections}  # fmt: skip


def write_long_run(source: Path, folder: Path, length_mm: float, coarser: int) -> int:
    """Write a run folder of about ``length_mm``; every ``coarser``-th cell and texel is kept.

    Returns how often the source was repeated.
    """
    run = RunFiles(source.resolve())
    wall = run.artefact(Wall).radius_map
    rows = len(wall.distance_mm) // coarser * coarser
    step = float(wall.distance_mm[1] - wall.distance_mm[0]) * rows
    times = round(length_mm / step)
    RunFolder(folder).internal.mkdir(parents=True)
    store = RunFolder(folder).store
    for stage, kind in STAGES.items():
        made = _repeated(run.artefact(kind), times, step, rows, coarser)
        store.write(made, Provenance(stage, "1", KEY, 0.0, ()))
    _write_record(run, folder)
    _write_defects(run, folder, times, step)
    _write_model(source / "model.glb", folder / "model.glb", times, step)
    _write_radius_map(folder)
    return times


def _repeated(artefact: Any, times: int, step: float, rows: int, coarser: int) -> Any:
    shift = step * np.arange(times)
    match artefact:
        case RingSamples():
            few = slice(None, None, 4)
            shown = {f.name: getattr(artefact, f.name) for f in fields(artefact)}
            shown = {k: v[:, few] if np.ndim(v) == 2 else v for k, v in shown.items()}
            shown["azimuth_rad"] = artefact.azimuth_rad[few]
            of_all = ("azimuth_rad", "centre_px")
            return RingSamples(**{k: v if v is None or k in of_all else _tiled(v, times)
                                  for k, v in shown.items()})  # fmt: skip
        case Trajectory():
            T_pc = np.tile(artefact.T_pc, (times, 1, 1))
            T_pc[:, 2, 3] += np.repeat(shift, len(artefact.T_pc))
            tiled = {n: _tiled(getattr(artefact, n), times) for n in ("frame", "time_s", "covariance")}
            return replace(artefact, T_pc=T_pc, events=(), axis=_axis(artefact.axis, shift, step), **tiled)
        case Wall():
            empty = replace(artefact.cloud, **{f.name: getattr(artefact.cloud, f.name)[:0]
                                               for f in fields(artefact.cloud)})  # fmt: skip
            return Wall(empty, _radius_map(artefact.radius_map, times, step, rows, coarser), artefact.axis)
        case WallTexture():
            texels = round(step / artefact.mm_per_px)
            bgra = artefact.bgra[:texels]
            lacking = np.repeat(bgra[-1:], texels - len(bgra), 0)
            kept = np.concatenate([bgra, lacking])[::coarser, ::coarser]
            return WallTexture(
                _tiled(kept, times), artefact.distance_from_mm, step / len(kept), artefact.azimuth_from_rad,
                artefact.rad_per_px * coarser,
            )  # fmt: skip
        case Overlays():
            kept = slice(None, rows, coarser)
            levels = {o.name: _overlay(o, kept, coarser, times) for o in artefact.pictures}
            return replace(
                artefact, distance_mm=_distances(artefact.distance_mm, times, step, rows, coarser),
                azimuth_rad=artefact.azimuth_rad[::coarser],
                reference_radius_mm=artefact.reference_radius_mm[::coarser], **levels,
            )  # fmt: skip
    shown = {f.name: _tiled(getattr(artefact, f.name), times) for f in fields(artefact)}
    shown["distance_mm"] = shown["distance_mm"] + np.repeat(shift, len(artefact.distance_mm))
    return type(artefact)(**shown)


def _tiled(values: NDArray[Any], times: int) -> NDArray[Any]:
    return np.tile(values, (times,) + (1,) * (np.ndim(values) - 1))


def _overlay(overlay: Overlay, kept: slice, coarser: int, times: int) -> Overlay:
    return replace(overlay, level=_tiled(overlay.level[kept, ::coarser], times))


def _distances(s: Float, times: int, step: float, rows: int, coarser: int) -> Float:
    count = len(s[:rows:coarser])
    return s[0] + step / count * np.arange(count * times)


def _radius_map(wall: RadiusMap, times: int, step: float, rows: int, coarser: int) -> RadiusMap:
    grids = {n: _tiled(getattr(wall, n)[:rows:coarser, ::coarser], times)
             for n in ("radius_mm", "sigma_mm", "sigma_random_mm", "count", "misalignment_mm")}  # fmt: skip
    s = _distances(wall.distance_mm, times, step, rows, coarser)
    return RadiusMap(s, wall.azimuth_rad[::coarser], **grids)


def _axis(axis: PipeAxis, shift: Float, step: float) -> PipeAxis:
    """Return a straight axis, since the two ends of the source's own axis would not join."""
    s = np.linspace(axis.distance_mm[0], axis.distance_mm[0] + shift[-1] + step, 2 + len(shift))
    origin = np.stack([0 * s, 0 * s, s], -1)
    return PipeAxis(s, origin, np.tile(np.eye(3), (len(s), 1, 1)))


def _write_record(run: RunFiles, folder: Path) -> None:
    record = run.record()
    record["recording"]["name"] = "long"
    record["stages"] = [s | {"key": KEY} for s in record["stages"]]
    (folder / "run.json").write_text(json.dumps(record))


def _write_defects(run: RunFiles, folder: Path, times: int, step: float) -> None:
    listed, once = [], json.loads(run.defects_text())
    for k in range(times):
        for defect in once:
            moved = {n: defect[n] + k * step for n in ("distance_from_mm", "distance_to_mm")}
            outline = [[s + k * step, a] for s, a in defect["outline"]]
            listed.append(defect | moved | {"id": len(listed) + 1, "outline": outline})
    (folder / "defects.json").write_text(json.dumps(listed))


def _write_radius_map(folder: Path) -> None:
    wall = RunFiles(folder).artefact(Wall).radius_map
    arrays = {f.name: getattr(wall, f.name) for f in fields(wall)} | {"displaced_mm": wall.displaced_in()}
    np.savez(folder / "radius_map.npz", **arrays)


def _write_model(source: Path, target: Path, times: int, step: float) -> None:
    """Repeat the model's primitives; all data but positions is stored once and shared."""
    content = source.read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    document, binary = json.loads(content[20 : 20 + length]), content[28 + length :]
    once = document["meshes"][0]["primitives"]
    primitives, parts, end = [], [binary], len(binary)
    for k in range(times):
        for primitive in once:
            number = primitive["attributes"]["POSITION"]
            accessor = document["accessors"][number]
            view = document["bufferViews"][accessor["bufferView"]]
            start = view["byteOffset"]
            place = (
                np.frombuffer(binary[start : start + view["byteLength"]], np.float32).reshape(-1, 3).copy()
            )
            place[:, 2] += k * step / 1000
            low, high = (f(place, axis=0).tolist() for f in (np.min, np.max))
            document["bufferViews"].append(view | {"byteOffset": end})
            parts.append(place.tobytes())
            end += len(parts[-1])
            own = {"bufferView": len(document["bufferViews"]) - 1, "min": low, "max": high}
            document["accessors"].append(accessor | own)
            attributes = primitive["attributes"] | {"POSITION": len(document["accessors"]) - 1}
            primitives.append(primitive | {"attributes": attributes})
    document["meshes"][0]["primitives"] = primitives
    document["buffers"][0]["byteLength"] = end
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    with target.open("wb") as stream:
        stream.write(struct.pack("<5I", 0x46546C67, 2, 28 + len(text) + end, len(text), 0x4E4F534A) + text)
        stream.write(struct.pack("<2I", end, 0x004E4942))
        for part in parts:
            stream.write(part)
