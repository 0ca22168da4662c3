"""Drawn rows of the adjustment's equations, and the same as one dense system."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.bordered import Factor
from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.rows import LandmarkRows, Rows
from pipeline.arrays import Float, Int

FRAMES, BORDER, OWN = 9, 6, 3


def random_rows(random: np.random.Generator, count: int = 90, reach: int = 3) -> Rows:
    first = random.integers(0, FRAMES - reach, count)
    frame = first[:, None] + np.array([0, 1, reach])
    return Rows(
        frame, random.standard_normal((count, 3, BLOCK)), random.standard_normal((count, BORDER)),
        random.standard_normal(count), random.uniform(0.7, 1.4, count),
    )  # fmt: skip


def random_landmarks(random: np.random.Generator, count: int = 7, reach: int = 4) -> LandmarkRows:
    first = random.integers(0, FRAMES - reach, count)
    frame = np.concatenate([f + np.arange(reach) for f in first])
    m = len(frame)
    draw = random.standard_normal
    return LandmarkRows(
        reach * np.arange(count + 1), frame, draw((m, 2, 6)), draw((m, 2, 3)), draw((m, 2, OWN)),
        draw((m, 2)), random.uniform(0.7, 1.4, m), draw((count, 3)), draw((count, BORDER)), draw(count),
        random.uniform(0.7, 1.4, count),
    )  # fmt: skip


def dense(rows: Rows, marks: LandmarkRows) -> tuple[Float, Float, Float]:
    """Return Jacobian, residual and weight of all equations; unknowns are frames, border, landmarks."""
    count = len(marks.start) - 1
    border_at, marks_at = BLOCK * FRAMES, BLOCK * FRAMES + BORDER
    size = marks_at + 3 * count
    j, r, w = [], [], []
    for k in range(len(rows.residual)):
        line = np.zeros(size)
        for p, f in enumerate(rows.frame[k]):
            line[BLOCK * f : BLOCK * f + BLOCK] += rows.by_frame[k, p]
        line[border_at:marks_at] = rows.by_border[k]
        j.append(line), r.append(rows.residual[k]), w.append(rows.weight[k])
    for k in range(count):
        mine = slice(marks_at + 3 * k, marks_at + 3 * k + 3)
        line = np.zeros(size)
        line[border_at:marks_at], line[mine] = marks.surface_by_border[k], marks.surface_by_point[k]
        j.append(line), r.append(marks.surface_residual[k]), w.append(marks.surface_weight[k])
        for m in range(marks.start[k], marks.start[k + 1]):
            for i in range(2):
                line, f = np.zeros(size), BLOCK * marks.frame[m]
                line[f : f + 6], line[mine] = marks.by_pose[m, i], marks.by_point[m, i]
                line[marks_at - OWN : marks_at] = marks.by_instrument[m, i]
                j.append(line), r.append(marks.residual[m, i]), w.append(marks.weight[m])
    return np.array(j), np.array(r), np.array(w)


def frame_covariance(factor: Factor, frames: Int) -> Float:
    """Return (len(frames), 7, 7) marginal covariances."""
    each = np.arange(len(frames))
    return np.asarray(factor.joint_covariance(frames)[each, :, each])
