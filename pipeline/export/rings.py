"""rings.zarr: what was measured of the laser ring, frame by frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts.measured import RingSamples, RingValidity

if TYPE_CHECKING:
    import zarr

_FRAMES_PER_CHUNK = 64


def write_rings(rings: RingSamples, folder: Path) -> None:
    """Write ``rings.zarr``: laser frames × azimuth, with the meaning of every array in its attributes."""
    # zarr is slow to import: a run is under way by then.
    import zarr

    group = zarr.open_group(folder / "rings.zarr", mode="w")
    group.attrs.update(
        {
            "format": 1,
            "centre_px": [float(c) for c in rings.centre_px],
            "validity_codes": {v.name.lower(): int(v) for v in RingValidity},
        }
    )
    tables = {
        "radius_px": (rings.radius_px, "line position along the azimuth, px"),
        "sigma_px": (rings.sigma_px, "1 sigma of the position from image noise, px"),
        "line_width_px": (rings.width_px, "1 sigma of the line's profile, px"),
        "amplitude": (rings.amplitude, "height above the background, grey levels"),
        "valid": (rings.valid, "true where the sample may be used"),
        "validity": (rings.validity, "why a sample is not used, see validity_codes"),
        "frame": (rings.frame, "frame number of each row"),
        "azimuth_rad": (rings.azimuth_rad, "image azimuth of each column about centre_px, rad"),
    }
    for name, (values, meaning) in tables.items():
        _write_array(group, name, np.asarray(values), meaning)


def _write_array(group: zarr.Group, name: str, values: NDArray[Any], meaning: str) -> None:
    chunks = (min(_FRAMES_PER_CHUNK, max(1, len(values))), *values.shape[1:]) if values.ndim > 1 else None
    array = group.create_array(name, data=values, chunks=chunks or "auto")
    array.attrs["description"] = meaning
