"""Synthetic brightness of sectors in frames, with what the twin finds in it."""

import numpy as np

from pipeline.instrument.probe import Lighting
from stages.twin.causes import causes
from stages.twin.cells import SECTORS, Cells, sector_azimuth_rad
from stages.twin.scene import Ring

RING, FRAMES = Ring((400.0, 300.0), 200.0, 50.0, 23.0), 18
NUMBER = 10 * np.arange(FRAMES)
AZIMUTH_DEG = np.degrees(sector_azimuth_rad())


def cells_with(change, seed=0, of_photo=0.01):
    """Return cells with noise of 1 σ per pixel, a photo error in each cell, and a logarithmic change."""
    random = np.random.default_rng(seed)
    pixels, level = 500.0, 20.0
    photo = of_photo * random.standard_normal((FRAMES, SECTORS))
    ratio = np.exp(photo + change) + random.standard_normal((FRAMES, SECTORS)) / (level * np.sqrt(pixels))
    own = np.full((FRAMES, SECTORS), pixels * level**2)
    square = pixels * (1 + (ratio * level) ** 2)
    return Cells(
        NUMBER, square, ratio * own, own, np.full_like(own, pixels), np.full_like(own, pixels * level)
    )


def found_in_cells(lit=0.0, line=0.0, seed=0):
    """Return what is found in frames of both lights with logarithmic changes (F, S) of each."""
    zero = np.zeros((FRAMES, SECTORS))
    return causes(
        cells_with(zero + lit, seed), cells_with(zero + line, seed + 1000, of_photo=0.05), Lighting(), RING
    )[0]


def step_from(first):
    """Return a step (F, 1) by 1 from a frame on."""
    return (np.arange(FRAMES) >= first)[:, None].astype(float)
