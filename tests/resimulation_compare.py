"""A recorded frame compared with the same frame rendered.

Position of the line, and similarity of the pictures.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from pipeline.arrays import Float, Image
from pipeline.recording.base import Illumination
from pipeline.simulator.render import renderer_of
from pipeline.simulator.sensor import through_lens
from pipeline.simulator.truth import SceneTruth

_REACH_PX, _STEP_PX, _SIGMA_PX, _STEPS = 8.0, 0.5, 1.3, 4
_LEAST_HEIGHT, _CLIPPED, _GAIN_STEPS = 12.0, 250, 4


def lights_of(truth: SceneTruth, frame: int) -> list[Float]:
    """Render each light (H, W, 3) of a frame alone through the lens, in full scales, without noise."""
    shown = truth.frames.illumination[frame]
    kinds = (Illumination.LASER, Illumination.LED) if shown == Illumination.BOTH else (Illumination(shown),)
    parts = []
    for kind in kinds:
        alone = np.full(len(truth.frames.frame), kind.value)
        renderer = renderer_of(replace(truth, frames=replace(truth.frames, illumination=alone)))
        parts.append(through_lens(renderer.light(frame), truth.instrument.sensor, None).astype(float))
    return parts


def matched(recorded: Image, lights: list[Float]) -> Image:
    """Return the rendered frame, each light's share of each channel fitted to the recording, clipped."""
    out = np.empty(recorded.shape, np.uint8)
    for c in range(3):
        seen = recorded[..., c].astype(float)
        columns = np.stack([light[..., c] for light in lights], -1)
        lit = columns.sum(-1) > 1e-3
        gain = np.full(len(lights), 255.0)
        for _ in range(_GAIN_STEPS):
            use = lit & (seen < _CLIPPED) & (columns @ gain < _CLIPPED)
            gain = np.linalg.lstsq(columns[use], seen[use], rcond=None)[0]
        out[..., c] = np.clip(columns @ gain + 0.5, 0, 255)
    return out


def line_radii(image: Image, near_px: Float, azimuth_rad: Float, centre_px: Float) -> Float:
    """Return the image radius (A,) of the line, px, along image azimuths about ``centre_px``.

    NaN where too faint. A Gaussian on a linear background is fitted, starting at ``near_px`` (A,): a wall lit
    by LEDs beside the line would move a centroid.
    """
    along = np.arange(-_REACH_PX, _REACH_PX + _STEP_PX / 2, _STEP_PX)
    bell = np.exp(-0.5 * (along / _SIGMA_PX) ** 2)
    design = np.stack([bell, bell * along / _SIGMA_PX**2, np.ones_like(along), along], 1)
    solve = np.linalg.pinv(design)
    green, rho = image[..., 1].astype(np.float32), near_px.copy()
    for _ in range(_STEPS):
        at = rho[:, None] + along
        u = (centre_px[0] + at * np.cos(azimuth_rad)[:, None]).astype(np.float32)
        v = (centre_px[1] + at * np.sin(azimuth_rad)[:, None]).astype(np.float32)
        height, slope = (cv2.remap(green, u, v, cv2.INTER_LINEAR) @ solve.T)[:, :2].T
        rho = rho + np.clip(slope / np.where(height > _LEAST_HEIGHT, height, np.nan), -1, 1)
    return rho


def psnr_db(recorded: Image, rendered: Image) -> float:
    """Return the peak signal to noise ratio of two frames over all channels."""
    off = recorded.astype(float) - rendered.astype(float)
    return float(20 * np.log10(255 / np.sqrt(np.mean(off**2))))
