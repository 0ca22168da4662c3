"""What a diagnosis leaves beside its answer: the corrected probe and the residuals as arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import write_probe
from stages.diagnose.diagnose import Examination


def write_files(examination: Examination, stated: Probe, made_by: MadeBy, folder: Path) -> None:
    """Write probe.yaml and arrays.npz; without a gauge run the probe stays as stated.

    Raises
    ------
    OSError
        When they cannot be written.
    """
    correction = examination.correction
    write_probe(correction.probe if correction is not None else stated, folder / "probe.yaml", made_by)
    arrays = _arrays(examination)
    if arrays:
        # Named as a stream: savez would else append .npz to a name of its own.
        with (folder / "arrays.npz").open("wb") as stream:
            np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]


def _arrays(examination: Examination) -> dict[str, NDArray[Any]]:
    """Return residuals over azimuth and frame, and over the unrolled wall, in mm, before and after."""
    found = examination.found
    out: dict[str, NDArray[Any]] = {}
    if found.ring_picture is not None:
        p = found.ring_picture
        out |= {"frame": p.frame, "azimuth_c_rad": p.azimuth_rad}
        out |= {"before_mm": p.before_mm, "after_mm": p.after_mm}
    if found.wall_picture is not None:
        w = found.wall_picture
        out |= {"wall_distance_mm": w.distance_mm, "wall_azimuth_p_rad": w.azimuth_rad}
        out |= {"wall_before_mm": w.before_mm, "wall_after_mm": w.after_mm}
    return out
