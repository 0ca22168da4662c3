"""trajectory.csv: where the camera was at every frame, each coordinate with its 1 sigma."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.rigid import quaternion_from_rotation

_POSE = ("frame", "time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
_SIGMA = ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "sigma_rx_rad", "sigma_ry_rad", "sigma_rz_rad")


def write_trajectory(trajectory: Trajectory, folder: Path) -> None:
    """Write ``trajectory.csv``: the camera in P; rotation sigmas are those of a rotation vector in C."""
    sigma = np.sqrt(np.diagonal(trajectory.covariance, axis1=-2, axis2=-1))
    quaternion = quaternion_from_rotation(trajectory.T_pc[:, :3, :3])
    values = np.column_stack([trajectory.time_s, trajectory.T_pc[:, :3, 3], quaternion, sigma])
    with (folder / "trajectory.csv").open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow([*_POSE, *_SIGMA])
        rows.writerows(
            [int(f), *(f"{v:.9g}" for v in row)] for f, row in zip(trajectory.frame, values, strict=True)
        )
