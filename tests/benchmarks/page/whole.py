"""The whole run compared with COLMAP on the LED frames, where COLMAP is installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import least_squares

from tests.benchmarks.page.charts import bars
from tests.benchmarks.page.colmap import installed
from tests.benchmarks.page.inputs import Inputs
from tests.benchmarks.page.section import TIMES, Method, Quantity, Section, clocked
from tests.shared_data import PROJECT_ROOT

_EVERY, _NAME = 5, "COLMAP, sparse"
_SETUP = (
    f"COLMAP (pycolmap) gets each {_EVERY}th LED frame, the probe's camera as OPENCV_FISHEYE, held fixed, "
    "sequential matching and incremental mapping, two threads, no GPU, and a time limit. By its defaults it "
    "refuses to begin with pictures taken along the line of sight: that is allowed it. It has no laser and "
    "no encoder; its scale is set by the encoder's total, and its diameter is that of the cylinder fitted to "
    "its points. It stops at sparse points: a dense wall and its texture would come on top.",
    "Boresight's time is that of the whole run as started from the command line, to the model, findings and "
    "report. The recording's own duration is the time the camera took.",
)
_QUANTITIES = (
    Quantity("registered_percent", "LED frames with a pose, of those given", "%", "more"),
    Quantity("diameter_error_percent", "error of the mean diameter", "%"),
    Quantity("diameter_sigma_percent", "its stated 1 σ", "%", None),
    Quantity("points", "points on the wall", better="more"),
    *TIMES,
    Quantity("over_duration", "time over the recording's duration"),
)
_WHY_BEHIND = {
    "diameter_error_percent": "Boresight's radius hangs on the stated distance from camera to laser, "
    "COLMAP's on the encoder's total: each errs by one draw of its σ. Boresight states its own, and a "
    "calibrated probe makes it smaller; COLMAP states none.",
}


def section(inputs: Inputs, work: Path, limit_s: float) -> Section:
    """Return the comparison; without pycolmap, or when it finds nothing, with a row that says so."""
    times = inputs.recording.frames.time_s
    duration = float(np.ptp(times)) + 1 / inputs.recording.frame_rate
    own = Method("boresight, whole run", _own(inputs, duration))
    other = _colmap(inputs, work, limit_s, duration) if installed() else Method(_NAME, {}, "not installed")
    stages = {name: seconds for name, seconds in inputs.stage_seconds.items() if seconds > 0}
    charts = (bars(stages, f"Boresight's stages ({duration:.0f} s of recording)", "s", len(stages)),)
    return Section("whole", "Whole run", _SETUP, _QUANTITIES, (own, other), charts, _WHY_BEHIND)


def _own(inputs: Inputs, duration: float) -> dict[str, float | None]:
    radius = inputs.wall.radius_map.radius_mm
    posed = np.isin(inputs.lit, inputs.trajectory.frame).mean()
    return {
        "registered_percent": 100 * float(posed),
        "diameter_error_percent": 100 * abs(float(np.nanmean(radius)) / _true_radius(inputs) - 1),
        "diameter_sigma_percent": 100 * float(np.nanmedian(inputs.wall.radius_map.sigma_mm / radius)),
        "points": float(len(inputs.cloud.radius_mm)),
        "over_duration": inputs.spent.wall_s / duration,
    } | inputs.spent.figures


def _colmap(inputs: Inputs, work: Path, limit_s: float, duration: float) -> Method:
    given = inputs.lit[::_EVERY]
    pictures, result = work / "pictures", work / "colmap.npz"
    pictures.mkdir(parents=True)
    for number, image in inputs.recording.read(given, "grey"):
        cv2.imwrite(str(pictures / f"{number:06d}.png"), image)
    # COLMAP's pixel centres lie at halves.
    camera = inputs.probe.camera.parameters + np.array([0, 0, 0.5, 0.5, 0, 0, 0, 0])
    arguments = [str(pictures), ",".join(f"{p:.8g}" for p in camera), str(result)]
    note = ""
    with clocked() as spent:
        try:
            command = [sys.executable, "-m", "tests.benchmarks.page.colmap", *arguments]
            subprocess.run(command, cwd=PROJECT_ROOT, check=True, capture_output=True, timeout=limit_s)
        except subprocess.TimeoutExpired:
            note = f"ended after {limit_s:.0f} s without a result"
        except subprocess.CalledProcessError as error:
            note = "failed: " + error.stderr.decode(errors="replace")[-200:]
    figures = spent.figures | {"over_duration": spent.wall_s / duration, "registered_percent": 0.0}
    if result.exists():
        figures |= _found(inputs, result, given)
    return Method(_NAME, figures, note or ("" if result.exists() else "registered no two frames"))


def _found(inputs: Inputs, result: Path, given: np.ndarray) -> dict[str, float | None]:
    with np.load(result) as model:
        points, centres, names = model["points"], model["centres"], model["names"]
    frames = np.array([int(Path(str(n)).stem) for n in names])
    scale = inputs.driven_mm(frames) / np.linalg.norm(centres[-1] - centres[0])
    diameter = 2 * scale * _cylinder_radius(points, centres)
    return {
        "registered_percent": 100 * len(frames) / len(given),
        "diameter_error_percent": 100 * abs(float(diameter) / 2 / _true_radius(inputs) - 1),
        "points": float(len(points)),
    }


def _cylinder_radius(points: np.ndarray, centres: np.ndarray) -> float:
    """Return the radius of a cylinder fitted robustly to points, starting along the camera's path."""
    along = np.linalg.svd(centres - centres.mean(0))[2][0]
    across = np.linalg.svd(along[None])[2][1:]
    off = (points - centres.mean(0)) @ np.stack([*across, along], 1)
    size = float(np.median(np.hypot(off[:, 0], off[:, 1])))

    def misfit(p: np.ndarray) -> np.ndarray:
        x, y = (off[:, i] / size - p[i] - p[2 + i] * off[:, 2] / size for i in (0, 1))
        return np.hypot(x, y) - p[4]

    return size * float(least_squares(misfit, [0, 0, 0, 0, 1.0], loss="cauchy", f_scale=0.01).x[4])


def _true_radius(inputs: Inputs) -> float:
    """Return the mean of the true radii."""
    with np.load(inputs.folder / "truth_wall.npz") as truth:
        s, radius = truth["distance_mm"], truth["radius_mm"]
    seen = inputs.wall.radius_map.distance_mm
    return float(radius[(s >= seen[0]) & (s <= seen[-1])].mean())
