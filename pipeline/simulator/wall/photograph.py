"""A photographed texture laid on the wall."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.errors import InputError
from pipeline.simulator.wall.description import Photograph
from pipeline.simulator.wall.grid import Grid

_SRGB_GAMMA = 2.2
_DARKEST, _BRIGHTEST = 0.01, 0.95


def lay_photograph(grid: Grid, photograph: Photograph, folder: Path) -> Float32:
    """Return the albedo (S, A, 3), red, green, blue, of a picture laid on the wall.

    Rows of the picture run along the distance. It is scaled by at most half a tile so that a whole, even
    number of tiles, every other one mirrored, closes around the wall without a seam.

    Raises
    ------
    InputError
        When the picture cannot be read.
    """
    picture = _linear(folder / photograph.file)
    picture *= photograph.mean_albedo / max(float(picture.mean()), 1e-6)
    tile_mm = picture.shape[1] * photograph.mm_per_px
    tiles = max(2 * round(np.pi * grid.radius_mm / tile_mm), 2)
    u = (grid.azimuth_rad + np.pi) / (2 * np.pi) * tiles * picture.shape[1]
    v = (grid.distance_mm - grid.distance_mm[0]) / photograph.mm_per_px
    x, y = np.meshgrid(
        _mirrored(u, picture.shape[1]).astype(np.float32), _mirrored(v, picture.shape[0]).astype(np.float32)
    )
    laid = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(np.clip(laid, _DARKEST, _BRIGHTEST), np.float32)


def _linear(file: Path) -> Float32:
    """Return a picture (H, W, 3) as linear red, green, blue from 0 to 1."""
    picture = cv2.imread(str(file), cv2.IMREAD_COLOR) if file.is_file() else None
    if picture is None:
        raise InputError(
            file, "cannot be read as a picture", expected="a JPEG or PNG file", hint="check pipe.photograph"
        )
    return np.asarray((picture[..., ::-1].astype(np.float32) / 255) ** _SRGB_GAMMA, np.float32)


def _mirrored(pixel: Float, size: int) -> Float:
    """Return positions folded back and forth into a picture, as centres from 0 to size − 1."""
    folded = np.mod(pixel, 2 * size)
    return np.asarray(np.minimum(folded, 2 * size - folded) - 0.5)
