"""COLMAP in a separate process that can be stopped: features, sequential matches, incremental mapping.

usage: python -m tests.benchmarks.page.colmap PICTURES PARAMETERS RESULT
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

_OVERLAP, _THREADS, _LEAST_ANGLE_DEG = 8, 2, 8.0


def installed() -> bool:
    """Return whether pycolmap, which is optional, is installed."""
    return find_spec("pycolmap") is not None


def reconstruct(pictures: Path, parameters: str, result: Path) -> None:
    """Reconstruct from pictures of one OPENCV_FISHEYE camera of known parameters; write the largest model.

    ``result`` gets points (P, 3), camera centres (N, 3) and the names (N,) of the registered pictures.
    """
    import pycolmap

    database = result.with_suffix(".db")
    reader = pycolmap.ImageReaderOptions(camera_model="OPENCV_FISHEYE", camera_params=parameters)
    pycolmap.extract_features(
        database, pictures, camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reader,
        extraction_options=pycolmap.FeatureExtractionOptions(num_threads=_THREADS, use_gpu=False),
        device=pycolmap.Device.cpu,
    )  # fmt: skip
    pycolmap.match_sequential(
        database, matching_options=pycolmap.FeatureMatchingOptions(num_threads=_THREADS, use_gpu=False),
        pairing_options=pycolmap.SequentialPairingOptions(overlap=_OVERLAP, quadratic_overlap=False),
        device=pycolmap.Device.cpu,
    )  # fmt: skip
    options = pycolmap.IncrementalPipelineOptions(num_threads=_THREADS)
    # With its default it refuses to start: a probe in a pipe moves along its line of sight.
    options.mapper.init_max_forward_motion, options.mapper.init_min_tri_angle = 1.0, _LEAST_ANGLE_DEG
    # The camera of the probe file is the best available: refining it in a tube only bends the tube.
    options.ba_refine_focal_length = options.ba_refine_principal_point = options.ba_refine_extra_params = (
        False
    )
    (result.parent / "models").mkdir(exist_ok=True)
    models = pycolmap.incremental_mapping(database, pictures, result.parent / "models", options=options)
    if models:
        _write(max(models.values(), key=lambda m: m.num_reg_images()), result)


def _write(model, result: Path) -> None:
    shown = sorted((i for i in model.images.values() if i.has_pose), key=lambda i: i.name)
    np.savez(
        result,
        points=np.array([p.xyz for p in model.points3D.values()]),
        centres=np.array([i.projection_center() for i in shown]),
        names=np.array([i.name for i in shown]),
    )


if __name__ == "__main__":
    reconstruct(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
