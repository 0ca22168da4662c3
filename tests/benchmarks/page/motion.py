"""Motion compared with textbook visual odometry on the same LED frames."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from tests.benchmarks.page.charts import COLOURS, chart
from tests.benchmarks.page.inputs import Inputs
from tests.benchmarks.page.odometry import klt, odometry, orb
from tests.benchmarks.page.section import TIMES, Method, Quantity, Section, clocked

_SETUP = (
    "All methods get the same LED frames and the probe's camera model. Visual odometry (OpenCV): features "
    "between 20° and 78° off the optical axis on contrast-equalised pictures, rays by the fisheye model, "
    "essential matrix by RANSAC, each step scaled by the pipe's known radius, and the whole path once more "
    "by the encoder's total: its distance at the end is the encoder's, not its own. Its first pose is the "
    "true one. Boresight uses rings, texture and encoder together.",
    "Errors are against the true poses from the first LED frame on: distance along the pipe, roll about it, "
    "and place across it after a straight line is taken out. Boresight's time is that of its stage motion.",
)
_QUANTITIES = (
    Quantity("distance_end_percent", "distance at the end", "%"),
    Quantity("distance_rms_mm", "distance, rms", "mm"),
    Quantity("roll_end_deg", "roll at the end", "°"),
    Quantity("roll_rms_deg", "roll, rms", "°"),
    Quantity("across_rms_mm", "across, rms", "mm"),
    Quantity("unscaled_percent", "distance before the encoder's total", "%", None),
    *TIMES,
)


def section(inputs: Inputs) -> Section:
    """Return the comparison."""
    lit = np.intersect1d(inputs.lit, inputs.trajectory.frame)
    truth = inputs.true_poses[lit]
    own = inputs.trajectory.T_pc[np.searchsorted(inputs.trajectory.frame, lit)]
    tracks = {"boresight, rings, texture and encoder": own}
    methods = [Method(next(iter(tracks)), _errors(own, truth) | {"wall_s": inputs.stage_seconds["motion"]})]
    images = inputs.lit_images()
    radius = inputs.recording.pipe.nominal_diameter_mm / 2
    for name, tracker in (("visual odometry, KLT", klt), ("visual odometry, ORB", orb)):
        with clocked() as spent:
            poses = odometry(images, inputs.probe, radius, tracker)
        poses = truth[0] @ poses
        before = _driven(poses)
        poses[:, :3, 3] = (
            truth[0, :3, 3] + (poses[:, :3, 3] - poses[0, :3, 3]) * inputs.driven_mm(lit) / before
        )
        tracks[name] = poses
        unscaled = {"unscaled_percent": 100 * (before / _driven(truth) - 1)}
        methods.append(Method(name, _errors(poses, truth) | unscaled | spent.figures))
    return Section("motion", "Motion", _SETUP, _QUANTITIES, tuple(methods), _charts(tracks, truth))


def _driven(poses: np.ndarray) -> float:
    return float(poses[-1, 2, 3] - poses[0, 2, 3])


def _errors(poses: np.ndarray, truth: np.ndarray) -> dict[str, float | None]:
    along, roll = _along(poses, truth), _roll(poses, truth)
    across = poses[:, :2, 3] - truth[:, :2, 3]
    line = np.stack([np.ones(len(poses)), np.linspace(-1, 1, len(poses))], 1)
    across = across - line @ np.linalg.lstsq(line, across, rcond=None)[0]
    return {
        "distance_end_percent": abs(100 * float(along[-1]) / _driven(truth)),
        "distance_rms_mm": float(np.sqrt(np.mean(along**2))),
        "roll_end_deg": abs(float(roll[-1])),
        "roll_rms_deg": float(np.sqrt(np.mean(roll**2))),
        "across_rms_mm": float(np.sqrt(np.mean((across**2).sum(1)))),
    }


def _along(poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
    error = poses[:, 2, 3] - truth[:, 2, 3]
    return error - error[0]


def _roll(poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
    turn, right = (np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0])) for T in (poses, truth))
    return np.degrees((turn - right) - (turn - right)[0])


def _charts(tracks: dict[str, np.ndarray], truth: np.ndarray) -> tuple[str, str]:
    z = truth[:, 2, 3] - truth[0, 2, 3]

    def draw(error):
        def curves(axes: Axes) -> None:
            for colour, (name, poses) in zip(COLOURS, tracks.items(), strict=False):
                axes.plot(z, error(poses, truth), color=colour, label=name)

        return curves

    return (
        chart(draw(_along), "Error of the distance", "true distance, mm", "mm"),
        chart(draw(_roll), "Error of the roll", "true distance, mm", "°"),
    )
