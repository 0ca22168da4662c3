"""Texture against the projection of pictures onto a mesh, as multi-view pipelines end, by open3d."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np

from pipeline.artefacts import WallTexture
from pipeline.export.unrolled import write_unrolled
from pipeline.geometry.axis import from_pipe
from pipeline.geometry.rigid import inverse
from pipeline.native import open3d
from stages.texture.light import irradiance
from tests.benchmarks.page.charts import bars
from tests.benchmarks.page.inputs import Inputs
from tests.benchmarks.page.section import TIMES, Method, Quantity, Section, clocked
from tests.shared_data import PROJECT_ROOT

_EVERY, _SIDES, _TILT_DEG, _FIELD_DEG, _VIEW_PX = 12, 8, 62.0, 50.0, 512
_TEXTURE_PX = 4096
_SETUP = (
    "All get boresight's poses, wall and LED frames. open3d (t.geometry, project_images_to_albedo) takes "
    f"pinhole pictures: each {_EVERY}th LED frame is cut into {_SIDES} undistorted views of {_FIELD_DEG:g}° "
    f"that look {_TILT_DEG:g}° off the axis, {_VIEW_PX} px wide, half as fine again as the fisheye itself. "
    f"Its mesh is the radius map, its texture {_TEXTURE_PX} px square over the unrolled wall, brought to "
    "the size of boresight's picture.",
    "Score: shared/score_run.py, which compares the flat picture with the true albedo after one gain per "
    "colour, and finds the shift of 10 mm patches. Boresight estimates the light, the projection just blends "
    "pictures; in the row 'light divided out' it is given boresight's model of the LEDs to divide by first. "
    "Boresight's time is that of its stage texture, with decoding.",
)
_QUANTITIES = (
    Quantity("psnr_db", "PSNR against the true albedo", "dB"),
    Quantity("registration_p95_mm", "shift of patches, 95 % below", "mm"),
    Quantity("textured_percent", "textured", "%"),
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
            views = _views(inputs, even)
            albedo = _projected(inputs, own, views)
        picture = WallTexture(
            albedo, own.distance_from_mm, own.mm_per_px, own.azimuth_from_rad, own.rad_per_px
        )
        methods.append(Method(name, _score(inputs, picture, work / name.replace(" ", "-")) | spent.figures))
    chart = bars(
        {m.name: m.figures["psnr_db"] for m in methods}, "Agreement with the true albedo", "PSNR, dB"
    )
    return Section("texture", "Texture", _SETUP, _QUANTITIES, tuple(methods), (chart,))


def _views(inputs: Inputs, even: bool) -> list[_View]:
    """Return the pinhole pictures; ``even``: divided by the light that a centred pipe's wall would get."""
    frames = np.intersect1d(inputs.lit, inputs.trajectory.frame)[::_EVERY]
    T_cp = inverse(inputs.trajectory.T_pc[np.searchsorted(inputs.trajectory.frame, frames)])
    focal = _VIEW_PX / 2 / np.tan(np.radians(_FIELD_DEG / 2))
    intrinsic = np.array([[focal, 0, _VIEW_PX / 2], [0, focal, _VIEW_PX / 2], [0, 0, 1]])
    sides = [_side(inputs, turn, intrinsic) for turn in 2 * np.pi * np.arange(_SIDES) / _SIDES]
    views = []
    for (_, bgr), T in zip(inputs.recording.read(frames, "bgr"), T_cp, strict=True):
        for T_vc, uv, light in sides:
            image = cv2.remap(bgr, uv, None, cv2.INTER_CUBIC)
            if even:
                image = np.clip(image / light[..., None], 0, 255).astype(np.uint8)
            views.append(_View(np.ascontiguousarray(image[..., ::-1]), intrinsic, T_vc @ T))
    return views


def _side(inputs: Inputs, turn: float, intrinsic: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a view's rotation from the camera, the pixels it shows, and the light there, mean 1."""
    tilt = np.radians(_TILT_DEG)
    forward = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    T_vc = np.eye(4)
    T_vc[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    pixel = np.stack(np.meshgrid(*[np.arange(_VIEW_PX) + 0.5] * 2), -1)
    ray_v = np.concatenate(
        [(pixel - intrinsic[:2, 2]) / intrinsic[0, 0], np.ones((_VIEW_PX, _VIEW_PX, 1))], -1
    )
    ray_c = ray_v @ T_vc[:3, :3]
    uv = inputs.probe.camera.project(ray_c).uv.astype(np.float32)
    return T_vc, np.nan_to_num(uv, nan=-1.0), _light(inputs, ray_c)


def _light(inputs: Inputs, ray_c: np.ndarray) -> np.ndarray:
    rho = np.linalg.norm(ray_c[..., :2], axis=-1, keepdims=True)
    xyz_c = ray_c / rho * inputs.recording.pipe.nominal_diameter_mm / 2
    normal = -np.concatenate([ray_c[..., :2] / rho, 0 * rho], -1)
    light = irradiance(inputs.probe.lighting, xyz_c, normal)
    return np.maximum(light / light.mean(), 0.05)


def _projected(inputs: Inputs, own: WallTexture, views: list[_View]) -> np.ndarray:
    """Return the flat picture (H, W, 4) that open3d makes, on the grid of boresight's."""
    o3d = open3d()
    tensor = o3d.core.Tensor
    albedo = _mesh(inputs, own).project_images_to_albedo(
        [o3d.t.geometry.Image(tensor(v.image)) for v in views],
        [tensor(v.intrinsic) for v in views], [tensor(v.T_cp) for v in views],
        tex_size=_TEXTURE_PX, update_material=False,
    )  # fmt: skip
    rgb = np.asarray(albedo.as_tensor().numpy())[..., :3]
    rgb = rgb if rgb.dtype == np.uint8 else np.clip(255 * rgb, 0, 255).astype(np.uint8)
    flat = cv2.resize(rgb[..., ::-1], own.bgra.shape[1::-1], interpolation=cv2.INTER_AREA)
    return np.dstack([flat, np.where(flat.max(-1) > 0, 255, 0).astype(np.uint8)])


def _mesh(inputs: Inputs, own: WallTexture):
    """Return the radius map as a mesh whose texture is the unrolled wall as boresight's picture shows it."""
    o3d, radius_map = open3d(), inputs.wall.radius_map
    length = own.bgra.shape[0] * own.mm_per_px
    s = np.arange(0, length + 1e-9, length / max(1, round(length / 2)))
    psi = own.azimuth_from_rad - own.rad_per_px / 2 + np.linspace(0, 2 * np.pi, 181)
    distance = own.distance_from_mm - own.mm_per_px / 2 + s
    row = np.clip(np.searchsorted(radius_map.distance_mm, distance), 0, len(radius_map.distance_mm) - 1)
    column = np.searchsorted(radius_map.azimuth_rad, (psi + np.pi) % (2 * np.pi) - np.pi) % len(
        radius_map.azimuth_rad
    )
    radius = radius_map.radius_mm[row][:, column]
    radius = np.where(np.isfinite(radius), radius, np.nanmedian(radius))
    xyz = from_pipe(inputs.wall.axis, distance[:, None], psi, radius)
    v, u = np.meshgrid(1 - s / length, np.linspace(0, 1, 181), indexing="ij")
    number = np.arange(xyz[..., 0].size).reshape(xyz.shape[:2])
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    face = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], 2).reshape(-1, 3)
    mesh = o3d.t.geometry.TriangleMesh(
        o3d.core.Tensor(xyz.reshape(-1, 3).astype(np.float32)), o3d.core.Tensor(face)
    )
    uv = np.stack([u, v], -1).reshape(-1, 2)[face]
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
        "psnr_db": told["psnr_db"],
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
