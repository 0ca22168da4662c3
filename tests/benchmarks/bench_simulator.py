"""Accuracy of the simulator's rendered line against its exact line, and its speed.

``python -m tests.benchmarks.bench_simulator [converge | speed | plain | gauge ...]`` prints

converge   mean and rms, px, of the rendered line's centroid less the exact line's, by samples a side of a
           pixel: a plain 4 inch pipe at 2 MP, without noise and codec. The line's own width moves the
           mean a little where image radius is not linear in height: that part is subtracted
speed      frames a second of laser and LED frames of two shipped scenes at 2 MP, without codec: CPU time of
           one frame, and time by the clock, which depends on the load of the machine
plain      LED frames against the plain method, which marches along every ray: CPU time of both for the
           light alone, and their difference in units of the sensor's noise, rms and largest
gauge      CPU time and time by the clock of the whole gauge run of 240 frames, with premises, codec and truth
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from pipeline.simulator.build import build_truth
from pipeline.simulator.produce import Order, Places, produce
from pipeline.simulator.render import Renderer, Shot, renderer_of, view_of
from pipeline.simulator.scene import read_scene
from pipeline.simulator.sensor import through_lens
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.view import View
from pipeline.simulator.wall_light import lamps_of
from pipeline.simulator.wall_tiles import add_wall
from tests.exact_rings import exact_rings
from tests.simulated import SCENES

_AZIMUTHS, _REACH_PX, _STEP_PX = 360, 12.0, 0.05
_SAMPLES = (1, 2, 3, 4, 6, 8)
_TIMED = 3


def scene_truth(name: str, **changes: object) -> SceneTruth:
    file = SCENES / f"{name}.yaml"
    scene = read_scene(file)
    return build_truth(scene.model_copy(update=changes), file)


def plain_pipe() -> SceneTruth:
    """Return the straight 4 inch scene with a bare uniform wall, so that only sampling can move the line."""
    scene = read_scene(SCENES / "straight-4-inch.yaml")
    bare = {"mottle": 0.0, "grain": 0.0, "rust": 0.0, "lime": 0.0, "gloss": 0.0}
    surface = scene.pipe.surface.model_copy(update=bare)
    relief = scene.pipe.relief.model_copy(update={"roughness_mm": 0.0})
    pipe = scene.pipe.model_copy(update={"surface": surface, "relief": relief, "defects": ()})
    laser = scene.laser.model_copy(update={"speckle": 0.0})
    return scene_truth("straight-4-inch", pipe=pipe, laser=laser)


def centroid_error(truth: SceneTruth, samples: int, frame: int = 0) -> tuple[float, float]:
    """Return mean and rms over azimuth of the rendered line's centroid less the exact line's, px."""
    rendering = truth.rendering.model_copy(update={"line_samples": samples})
    renderer = renderer_of(replace(truth, rendering=rendering))
    light = through_lens(renderer.light(frame), truth.instrument.sensor, None)[..., 1]
    centre, azimuth = truth.stated.camera.centre_px, np.linspace(-np.pi, np.pi, _AZIMUTHS, endpoint=False)
    exact = exact_rings(truth, [frame], azimuth, centre)[0]
    along = np.arange(-_REACH_PX, _REACH_PX, _STEP_PX)
    rho = exact[:, None] + along
    u = (centre[0] + rho * np.cos(azimuth)[:, None]).astype(np.float32)
    v = (centre[1] + rho * np.sin(azimuth)[:, None]).astype(np.float32)
    seen = cv2.remap(light, u, v, cv2.INTER_CUBIC).astype(float)
    error = (seen * along).sum(1) / seen.sum(1) - _drawn_by_width(truth, exact)
    return float(error.mean()), float(np.sqrt(np.mean(error**2)))


def _drawn_by_width(truth: SceneTruth, exact_px: np.ndarray) -> np.ndarray:
    """Return by how much the centroid of the light lies beyond the line.

    Half the curvature of radius over height. Brightness per image radius changes across the line too: light
    per height is uniform, and falls with the angle at which it meets the wall. Both are far below a hundredth
    of a pixel here; they are left in the error.
    """
    camera, laser = truth.instrument.camera.model, truth.instrument.laser
    wall, height = float(np.mean(truth.wall.radius_mm)), laser.sheet.baseline_mm
    rays = np.array([[wall, 0.0, height + h] for h in (-1.0, 0.0, 1.0)])
    radius = np.linalg.norm(camera.project(rays).uv - camera.centre_px, axis=1)
    curvature = radius[0] - 2 * radius[1] + radius[2]
    return np.full(len(exact_px), 0.5 * curvature * laser.profile.sigma_mm**2)


def converge() -> None:
    truth = plain_pipe()
    print("samples a side   mean px    rms px")
    for samples in _SAMPLES:
        mean, rms = centroid_error(truth, samples)
        print(f"{samples:14d} {mean:+9.5f} {rms:9.5f}", flush=True)


def speed() -> None:
    print("scene               light    CPU s/frame  by the clock  frames/s on two idle cores  by the clock")
    for name in ("straight-4-inch", "gauge-4-inch"):
        truth = scene_truth(name)
        renderer = renderer_of(truth)
        for kind in ("laser", "led"):
            frames = np.flatnonzero(truth.frames.illumination == kind)[5 : 5 + 12 * _TIMED : 12]
            renderer.frame(int(frames[0]))
            cpu, clock = timed(partial(all_of, renderer, frames))
            cpu, clock = cpu / len(frames), clock / len(frames)
            rates = f"{2 / cpu:10.1f} {1 / clock:27.1f}"
            print(f"{name:19} {kind:6} {cpu:11.3f} {clock:13.3f} {rates}", flush=True)


def plain() -> None:
    print("scene               CPU s/frame   plain CPU s   difference over noise: rms   largest")
    for name in ("straight-4-inch", "gauge-4-inch", "bent-2-inch"):
        truth = scene_truth(name)
        renderer = renderer_of(truth)
        shot = renderer.shot(int(np.flatnonzero(truth.frames.illumination == "led")[9]))
        view, sensor = view_of(renderer.scenery, shot), truth.instrument.sensor
        slow = view._replace(clear_mm=np.zeros_like(view.clear_mm))
        (image, taken), (exact, longer) = (lit_wall(v, shot) for v in (view, slow))
        noise = (
            np.sqrt(np.clip(exact, 0, 1) * sensor.full_well_e + sensor.read_noise_e**2) / sensor.full_well_e
        )
        z = (image - exact) / noise
        rms, most = float(np.sqrt(np.mean(z**2))), float(np.abs(z).max())
        print(f"{name:19} {taken:11.3f} {longer:13.3f} {rms:27.4f} {most:9.3f}", flush=True)


def lit_wall(view: View, shot: Shot) -> tuple[np.ndarray, float]:
    """Return the light of the LEDs (H, W, 3) and the CPU time that it takes once compiled."""
    width, height = shot.instrument.camera.model.image_size
    for _ in range(2):
        image = np.zeros((height, width, 3), np.float32)
        taken, _ = timed(partial(add_wall, view, lamps_of(shot.instrument.light), np.ones(3), 1, image))
    return image, taken


def all_of(renderer: Renderer, frames: np.ndarray) -> None:
    for _ in renderer.frames(frames.tolist()):
        pass


def gauge() -> None:
    file = SCENES / "gauge-4-inch.yaml"
    scene = read_scene(file)
    with tempfile.TemporaryDirectory() as folder:
        order = Order(scene, file, Places(Path(folder) / "gauge", Path(folder) / "truth"))
        cpu, clock = timed(lambda: produce([order], lambda order, done: None))
    print(f"gauge-4-inch, {scene.frames} frames: CPU {cpu:.0f} s, by the clock {clock:.0f} s")


def timed(call: Callable[[], object]) -> tuple[float, float]:
    """Return CPU time of all threads and time by the clock, s."""
    cpu, clock = time.process_time(), time.perf_counter()
    call()
    return time.process_time() - cpu, time.perf_counter() - clock


if __name__ == "__main__":
    studies = {"converge": converge, "speed": speed, "plain": plain, "gauge": gauge}
    for study in sys.argv[1:] or studies:
        studies[study]()
