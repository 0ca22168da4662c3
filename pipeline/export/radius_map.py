"""radius_map.npz: the wall's radius over distance and azimuth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.artefacts.measured import Wall


def write_radius_map(wall: Wall, folder: Path) -> None:
    """Write ``radius_map.npz``; NaN where nothing was seen."""
    radius = wall.radius_map
    np.savez_compressed(
        folder / "radius_map.npz",
        distance_mm=radius.distance_mm,
        azimuth_rad=radius.azimuth_rad,
        radius_mm=radius.radius_mm,
        sigma_mm=radius.sigma_mm,
        count=radius.count,
        sigma_random_mm=radius.sigma_random_mm,
        misalignment_mm=radius.misalignment_mm,
    )
