"""Whether the line is rendered finely enough to be where it is said to be."""

from __future__ import annotations

import numpy as np

from pipeline.simulator.premises.base import Premise
from pipeline.simulator.truth import SceneTruth

# A Gaussian of 0.5 steps 1 σ, summed at steps, moves by 0.002 steps at most.
_LEAST_STEPS = 0.5
_LITTLE_MM = 0.01


def line_premise(truth: SceneTruth) -> Premise:
    """Return how wide the line is, 1 σ in steps of its rendering, on the widest wall and before blur.

    A narrower line falls between the samples of a pixel and jumps with them.
    """
    per_step = line_px_per_mm(truth) * truth.rendering.line_samples
    return Premise(
        "width of the line in steps of its rendering", truth.instrument.laser.profile.sigma_mm * per_step,
        _LEAST_STEPS, hint="raise rendering.line_samples, or probe.laser.line_sigma_mm",
    )  # fmt: skip


def line_px_per_mm(truth: SceneTruth) -> float:
    """Return pixels of image radius a mm of height of the sheet, on the widest wall."""
    camera, height = truth.instrument.camera.model, truth.instrument.laser.sheet.baseline_mm
    radius = float(truth.wall.radius_mm.max())
    rays = np.array([[radius, 0.0, height - _LITTLE_MM], [radius, 0.0, height + _LITTLE_MM]])
    uv = camera.project(rays).uv
    return float(np.linalg.norm(uv[1] - uv[0]) / (2 * _LITTLE_MM))
