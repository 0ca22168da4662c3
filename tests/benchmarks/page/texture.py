"""Texture compared with open3d's projection of pictures onto a mesh, the last step of usual pipelines."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np

from pipeline.artefacts.measured import WallTexture
from pipeline.export.pictures import write_unrolled
from pipeline.geometry.axis import from_pipe
from pipeline.geometry.rigid import inverse
from pipeline.system.native import open3d
from stages.texture.light import irradiance
from tests.benchmarks.page.charts import bars
from tests.benchmarks.page.inputs import Inputs
from tests.benchmarks.page.section import TIMES, Method, Quantity, Section, clocked
from tests.shared_data import PROJECT_ROOT

_TILE_MM, _VIEWS, _TEXTURE_PX, _BANDS = 30.0, 6, 1024, 4
_NEAREST_DEG, _PASSED_MM, _FOCAL_PX = 72.0, 25.0, 200.0
_SETUP = (
    "All get boresight's poses, wall and LED frames. open3d (t.geometry, project_images_to_albedo) takes "
    f"pinhole pictures: {_VIEWS} LED frames for each {_TILE_MM:g} mm of wall, undistorted out to "
    f"{_NEAREST_DEG:g}° off the axis at about the fisheye's resolution there, taken while the probe came up "
    f"to the wall over {_PASSED_MM:g} mm. The wall is worked on in such pieces because the function also "
    "takes colours for what lies behind a camera. Its mesh is the radius map, its texture "
    f"{_TEXTURE_PX} px square a piece, in {_BANDS} bands, brought to the size of boresight's picture.",
    "Score: shared/score_run.py, which compares the flat picture with the true albedo after one gain per "
    "colour, and finds the shift of 10 mm patches. Boresight estimates the light, the projection just blends "
    "pictures; in the row 'light divided out' it is given boresight's model of the LEDs to divide by first. "
    "Boresight's time is that of its stage texture, with decoding.",
)
_QUANTITIES = (
    Quantity("psnr_db", "PSNR against the true albedo", "dB", "more"),
    Quantity("registration_p95_mm", "shift of patches, 95 % below", "mm"),
    Quantity("textured_percent", "textured", "%", "more"),
    *TIMES,
)


@dataclass(frozen=True)
class _View:
    """A pinhole picture with its matrices, camera from pipe."""

    image: np.ndarray
    intrinsic: np.ndarray
    T_cp: np.ndarray


def section(inputs: Inputs, work: Path) -> Section:
    """Return the comparison."""
    own = inputs.results[WallTexture]
    methods = [
        Method("boresight", _score(inputs, own, work / "own") | {"wall_s": inputs.stage_seconds["texture"]})
    ]
    for name, even in (("open3d, projected pictures", False), ("open3d, light divided out", True)):
        with clocked() as spent:
            albedo = _projected(inputs, own, even)
        picture = WallTexture(
            albedo, own.distance_from_mm, own.mm_per_px, own.azimuth_from_rad, own.rad_per_px
        )
        methods.append(Method(name, _score(inputs, picture, work / name.replace(" ", "-")) | spent.figures))
    chart = bars(
        {m.name: m.figures["psnr_db"] for m in methods}, "Agreement with the true albedo", "PSNR, dB"
    )
    return Section("texture", "Texture", _SETUP, _QUANTITIES, tuple(methods), (chart,))


def _views(inputs: Inputs, frames: np.ndarray, even: bool) -> dict[int, _View]:
    """Return frames as pinhole pictures; ``even`` divides them by the light on the wall of a centred pipe."""
    size = 2 * int(np.ceil(_FOCAL_PX * np.tan(np.radians(_NEAREST_DEG))))
    intrinsic = np.array([[_FOCAL_PX, 0, size / 2], [0, _FOCAL_PX, size / 2], [0, 0, 1]])
    pixel = np.stack(np.meshgrid(*[np.arange(size) + 0.5] * 2), -1)
    ray_c = np.concatenate([(pixel - size / 2) / _FOCAL_PX, np.ones((size, size, 1))], -1)
    uv = inputs.probe.camera.project(ray_c).uv.astype(np.float32)
    light = _light(inputs, ray_c)[..., None] if even else 1.0
    T_pc = inputs.trajectory.T_pc[np.searchsorted(inputs.trajectory.frame, frames)]
    return {
        int(frame): _View(_pinhole(bgr, uv, light), intrinsic, T)
        for (frame, bgr), T in zip(inputs.recording.read(frames, "bgr"), inverse(T_pc), strict=True)
    }


def _pinhole(bgr: np.ndarray, uv: np.ndarray, light: np.ndarray | float) -> np.ndarray:
    rgb = cv2.remap(bgr, uv, None, cv2.INTER_CUBIC)[..., ::-1]
    return np.ascontiguousarray(np.clip(rgb / light, 0, 255).astype(np.uint8))


def _light(inputs: Inputs, ray_c: np.ndarray) -> np.ndarray:
    rho = np.maximum(np.linalg.norm(ray_c[..., :2], axis=-1, keepdims=True), 1e-3)
    xyz_c = ray_c / rho * inputs.recording.pipe.nominal_diameter_mm / 2
    normal = -np.concatenate([ray_c[..., :2] / rho, 0 * rho], -1)
    light = irradiance(inputs.probe.lighting, xyz_c, normal)
    return np.maximum(light / light.max(), 0.02)


def _projected(inputs: Inputs, own: WallTexture, even: bool) -> np.ndarray:
    """Return the flat picture (H, W, 4) that open3d makes, on the grid of boresight's, piece by piece."""
    rows = max(1, round(_TILE_MM / own.mm_per_px))
    pieces = [range(r, min(r + rows, len(own.bgra))) for r in range(0, len(own.bgra), rows)]
    starts = [own.distance_from_mm + (p.start - 0.5) * own.mm_per_px for p in pieces]
    chosen = [_before(inputs, start) for start in starts]
    views = _views(inputs, np.unique(np.concatenate(chosen)), even)
    flat = [
        _piece(inputs, own, len(p), start, [views[int(k)] for k in frames])
        for p, start, frames in zip(pieces, starts, chosen, strict=True)
    ]
    return np.concatenate(flat)


def _piece(inputs: Inputs, own: WallTexture, rows: int, start_mm: float, views: list[_View]) -> np.ndarray:
    o3d, size = open3d(), (own.bgra.shape[1], rows)
    if not views:
        return np.zeros((*size[::-1], 4), np.uint8)
    albedo = _mesh(inputs, own, start_mm, rows * own.mm_per_px).project_images_to_albedo(
        [o3d.t.geometry.Image(o3d.core.Tensor(v.image)) for v in views],
        [o3d.core.Tensor(v.intrinsic) for v in views], [o3d.core.Tensor(v.T_cp) for v in views],
        tex_size=_TEXTURE_PX, update_material=False,
    )  # fmt: skip
    rgb = np.asarray(albedo.as_tensor().numpy())[..., :3]
    rgb = rgb if rgb.dtype == np.uint8 else np.clip(255 * rgb, 0, 255).astype(np.uint8)
    wide = np.concatenate(np.split(rgb[..., ::-1], _BANDS), axis=1)
    flat = cv2.resize(wide, size, interpolation=cv2.INTER_AREA)
    return np.dstack([flat, np.where(flat.max(-1) > 0, 255, 0).astype(np.uint8)])


def _before(inputs: Inputs, start_mm: float) -> np.ndarray:
    """Return frames, evenly spread, from which the piece beginning at ``start_mm`` is completely visible."""
    frames = np.intersect1d(inputs.lit, inputs.trajectory.frame)
    z = inputs.trajectory.T_pc[np.searchsorted(inputs.trajectory.frame, frames), 2, 3]
    least = inputs.recording.pipe.nominal_diameter_mm / 2 / np.tan(np.radians(_NEAREST_DEG - 2))
    seen = frames[(start_mm - z >= least) & (start_mm - z <= least + _PASSED_MM)]
    return seen[np.unique(np.linspace(0, len(seen) - 1, min(_VIEWS, len(seen))).round().astype(int))]


def _mesh(inputs: Inputs, own: WallTexture, start_mm: float, length_mm: float):
    """Return a piece of the radius map as a mesh, its texture unrolled as in boresight's picture."""
    o3d, radius_map = open3d(), inputs.wall.radius_map
    along, turn = np.linspace(0, 1, max(2, round(length_mm / 2))), np.linspace(0, 1, 181)
    distance = start_mm + length_mm * along
    psi = own.azimuth_from_rad - own.rad_per_px / 2 + 2 * np.pi * turn
    row = np.clip(np.searchsorted(radius_map.distance_mm, distance), 0, len(radius_map.distance_mm) - 1)
    column = np.searchsorted(radius_map.azimuth_rad, (psi + np.pi) % (2 * np.pi) - np.pi)
    radius = radius_map.radius_mm[row][:, column % len(radius_map.azimuth_rad)]
    radius = np.where(np.isfinite(radius), radius, np.nanmedian(radius))
    xyz = from_pipe(inputs.wall.axis, distance[:, None], psi, radius)
    number = np.arange(radius.size).reshape(radius.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    face = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], 2).reshape(-1, 3)
    # The texture is square: quarters of the ring lie in bands below each other.
    band = np.tile((np.arange(180) * _BANDS // 180)[None, :, None], (len(along) - 1, 1, 2)).ravel()[:, None]
    u = _BANDS * np.broadcast_to(turn, radius.shape).ravel()[face] - band
    v = 1 - (np.broadcast_to(along[:, None], radius.shape).ravel()[face] + band) / _BANDS
    uv = np.stack([u, v], -1)
    vertex = xyz.reshape(-1, 3).astype(np.float32)
    mesh = o3d.t.geometry.TriangleMesh(o3d.core.Tensor(vertex), o3d.core.Tensor(face))
    mesh.triangle.texture_uvs = o3d.core.Tensor(uv.astype(np.float32))
    return mesh


def _score(inputs: Inputs, picture: WallTexture, folder: Path) -> dict[str, float | None]:
    """Write the picture as a run would and let the shared tool score it."""
    folder.mkdir(parents=True, exist_ok=True)
    write_unrolled(picture, folder)
    tool, place = _score_tool(), str(inputs.folder)
    truth = tool.truth_of(place)
    wall = tool.wall_error(str(inputs.run), *truth[1:4]) | {"radius": truth[5]["radius"]}
    told = tool.texture_score(str(folder), place, wall)
    return {
        "psnr_db": float(told["psnr_db"]),
        "registration_p95_mm": told["registration_p95_mm"],
        "textured_percent": 100 * told["textured"],
    }


def _score_tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "score_run", PROJECT_ROOT.parent / "shared" / "score_run.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
