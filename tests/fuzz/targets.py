"""Every parser as a function of bytes: it accepts them, or refuses them with an `InputError`."""

from __future__ import annotations

import os
import struct
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pipeline.batch.cluster import read_cluster
from pipeline.drill.answer import read_answer, read_concealed
from pipeline.errors import InputError
from pipeline.export.run_record import read_run_record
from pipeline.instrument.camera.formats import read_camera, write_camera
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.configuration import resolve
from pipeline.machine.store import Store
from pipeline.recording import open_recording
from pipeline.recording.tables import read_encoder, read_frame_table
from pipeline.recording.video import open_video
from pipeline.review.decisions import action_of
from pipeline.review.model_stretches import read_model
from pipeline.review.run_files import RunFiles, measured_findings
from pipeline.review.server import PostedAction, PostedPoints, PostedSignature, parsed
from pipeline.simulator.prior import read_prior
from pipeline.simulator.scene import read_scene
from stages.catalogue import PIPELINE
from stages.compare.reference import read_wall_map, read_wall_points
from tests.made_recording import write_folder, write_mcap, write_ros1, write_ros2
from tests.shared_data import PROJECT_ROOT
from tests.truth_run import true_axis
from tests.unit.camera_samples import SCARAMUZZA

# The files opened in a folder with a bag.
BAGS = {"ros1": "run.bag", "ros2": "run", "mcap": "run.mcap"}
Take = Callable[[bytes], object]


@dataclass(frozen=True)
class Target:
    """A parser and a good input to start from.

    Attributes
    ----------
    take
        Parses bytes; may raise `InputError`, nothing else.
    seed
        Returns bytes that it takes.
    share
        Of all inputs: less for parsers that are slow.
    """

    take: Take
    seed: Callable[[], bytes]
    share: float


@cache
def scratch() -> Path:
    """Return this process' own folder, in memory where possible."""
    memory = Path("/dev/shm")
    within = memory if memory.is_dir() and os.access(memory, os.W_OK) else None
    return Path(tempfile.mkdtemp(prefix="boresight-fuzz-", dir=within))


@cache
def made() -> Path:
    """Return a folder with one good recording of each kind."""
    folder = scratch() / "made"
    write_folder(folder / "folder")
    write_folder(folder / "h264", "frames.mp4", codec="libx264", pix_fmt="yuv420p")
    write_folder(folder / "images", "frames/%06d.png")
    for kind, write in (("ros1", write_ros1), ("ros2", write_ros2), ("mcap", write_mcap)):
        (folder / kind).mkdir(parents=True)
        write(folder / kind)
    return folder


def _file(name: str, read: Callable[[Path], object]) -> Take:
    """Return a function that writes the bytes into a file of a new folder and parses it."""

    def take(data: bytes) -> object:
        file = scratch() / "one" / read.__name__.strip("<>") / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
        return read(file)

    return take


def _beside(kind: str, name: str) -> Take:
    """Return a function that replaces one file of a good recording by the bytes and opens the recording."""

    def take(data: bytes) -> object:
        folder = made() / kind
        target = folder / name
        good = target.read_bytes()
        try:
            target.write_bytes(data)
            return open_recording(folder / BAGS.get(kind, ""))
        finally:
            target.write_bytes(good)

    return take


def _model(data: bytes) -> object:
    file = scratch() / "model.glb"
    file.write_bytes(data)
    model = read_model(file, true_axis(0.0, 0.0))
    return model.stretches(), model.stretch(0)


def _smallest_model() -> bytes:
    """Return one triangle with one material, in the layout that boresight writes."""
    text = MODEL.encode() + b" " * (-len(MODEL) % 4)
    chunks = struct.pack("<2I", len(text), 0x4E4F534A) + text + struct.pack("<2I", 48, 0x004E4942) + bytes(48)
    return struct.pack("<3I", 0x46546C67, 2, 12 + len(chunks)) + chunks


def _pictures(data: bytes) -> object:
    """Replace one picture of a sequence and read all: that one may be unusable, the others may not."""
    folder = made() / "images"
    target = folder / "frames" / "000001.png"
    good = target.read_bytes()
    try:
        target.write_bytes(data)
        recording = open_recording(folder)
        return list(recording.read(recording.frames.frame, "bgr"))
    finally:
        target.write_bytes(good)


def _good(kind: str, name: str) -> Callable[[], bytes]:
    return lambda: (made() / kind / name).read_bytes()


def _shipped(name: str) -> Callable[[], bytes]:
    return (PROJECT_ROOT / "configs" / name).read_bytes


def _text(text: str) -> Callable[[], bytes]:
    return text.encode


def _of_run(file: Path) -> object:
    return read_run_record(file.parent), RunFiles(file.parent).record()


def _stored(file: Path) -> object:
    return Store(file.parent.parent).look("rings", "one", dict)


def _request(data: bytes) -> None:
    for kind in (PostedAction, PostedSignature, PostedPoints):
        with suppress(InputError):
            parsed(kind, data)


def _defects(data: bytes) -> object:
    return measured_findings(data.decode("utf-8", "replace"), Path("defects.json"))


def _answers(file: Path) -> None:
    for read in (read_answer, read_concealed):
        with suppress(InputError):
            read(file)


KALIBR = """cam0:
  camera_model: pinhole
  intrinsics: [460.0, 460.0, 376.0, 240.0]
  distortion_model: equidistant
  distortion_coeffs: [-0.01, 0.02, -0.01, 0.002]
  resolution: [752, 480]
"""
OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 300., 0., 320., 0., 300., 240., 0., 0., 1. ]
fisheye_model: 1
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ -0.01, 0.02, -0.01, 0.002 ]
"""
RUN = (
    '{"format": 1, "state": "completed", "recording": {"path": "a"}, "probe": {"path": "b"}, '
    '"input_sha256": {"recording": "1", "probe": "2"}, "configuration": {"rings": {"azimuths": 1440}}, '
    '"stages": [], "metrics": [], "reader_warnings": [], "warnings": []}'
)
DEED = '{"action": {"do": "accept", "finding": "1"}, "who": "me", "revision": 0}'
REDRAW = '{"do": "redraw", "finding": "1", "outline": [[0, 0], [1, 0], [1, 1]]}'
ANSWER = (
    '{"format": 1, "recording": "a", "gauge": "b", "verdict": "named", "global_p": 1e-9, '
    '"location": {"channel": "ring", "fixed_to": "laser", "harmonic": 1, "time": "static"}, '
    '"effects": [{"name": "laser_tilt", "probability": 0.99, '
    '"parameters": {"tilt_deg": {"value": 1, "sd": 2}}}]}'
)
MODEL = (
    '{"asset":{"version":"2.0"},"extensions":{"KHR_materials_variants":{"variants":[{"name":"photo"}]}},'
    '"extensionsUsed":["KHR_materials_variants"],"meshes":[{"primitives":[{"attributes":{"POSITION":0},'
    '"indices":1,"extensions":{"KHR_materials_variants":{"mappings":[{"material":0,"variants":[0]}]}}}]}],'
    '"accessors":[{"bufferView":0,"count":3,"min":[0,0,0],"max":[1,1,1]},{"bufferView":1,"count":3}],'
    '"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],"textures":[{"source":0}],'
    '"images":[{"bufferView":2}],"bufferViews":[{"byteOffset":0,"byteLength":36},'
    '{"byteOffset":36,"byteLength":6},{"byteOffset":42,"byteLength":4}]}'
)
CLUSTER = "cluster: {kind: slurm, jobs: 4, memory_gib: 6, walltime: 1-02:00:00}\n"
CONFIG = "rings: {azimuths: 720}\nmotion:\n  cell_px: 24\n"
FINDING = (
    '[{"id": 1, "kind": "pit", "outline": [[0, 0], [1, 0], [1, 1]], "distance_from_mm": 0, '
    '"distance_to_mm": 1, "clock_from": 1, "clock_to": 2, "length_mm": 1, "width_mm": 1, "depth_mm": 1, '
    '"depth_sigma_mm": 0.1, "wall_loss_percent": null, "probability": 1.0, "confidence": 0.9, "frames": [1]}]'
)


def _ocamcalib() -> bytes:
    write_camera(SCARAMUZZA, scratch() / "calib_results.txt", "ocamcalib")
    return (scratch() / "calib_results.txt").read_bytes()


def _map() -> bytes:
    import io

    import numpy as np

    buffer = io.BytesIO()
    distance, azimuth = np.arange(4.0), np.linspace(-3, 3, 8)
    np.savez(buffer, distance_mm=distance, azimuth_rad=azimuth, radius_mm=np.full((4, 8), 50.0))
    return buffer.getvalue()


def _cloud() -> bytes:
    names = ["x", "y", "z", "nx", "ny", "nz", "sigma_mm", "distance_mm", "azimuth_rad"]
    head = "ply\nformat ascii 1.0\nelement vertex 2\n" + "".join(f"property float {n}\n" for n in names)
    return f"{head}end_header\n{' '.join('1' * 9)}\n{' '.join('2' * 9)}\n".encode()


TARGETS = {
    "frames.csv": Target(_file("frames.csv", read_frame_table), _good("folder", "frames.csv"), 1),
    "encoder.csv": Target(_file("encoder.csv", read_encoder), _good("folder", "encoder.csv"), 1),
    "probe.yaml": Target(_file("probe.yaml", read_probe), _good("folder", "probe.yaml"), 0.2),
    "recording.yaml": Target(_beside("folder", "recording.yaml"), _good("folder", "recording.yaml"), 0.1),
    "cluster": Target(_file("k.yaml", read_cluster), _text(CLUSTER), 0.2),
    "model.glb": Target(_model, _smallest_model, 1),
    "configuration": Target(_file("c.yaml", lambda f: resolve(PIPELINE, f)), _text(CONFIG), 0.3),
    "scene": Target(_file("scene.yaml", read_scene), _shipped("scenes/oval-3-inch.yaml"), 0.2),
    "prior": Target(_file("prior.yaml", read_prior), _shipped("priors/small.yaml"), 0.2),
    "ocamcalib": Target(_file("calib_results.txt", read_camera), _ocamcalib, 1),
    "kalibr": Target(_file("camchain.yaml", read_camera), _text(KALIBR), 0.2),
    "opencv": Target(_file("camera.yml", read_camera), _text(OPENCV), 0.2),
    "run record": Target(_file("run.json", _of_run), _text(RUN), 1),
    "stored result": Target(_file("rings-one/manifest.json", _stored), _text('{"files": {}}'), 1),
    "defects": Target(_defects, _text(FINDING), 1),
    "review request": Target(_request, _text(DEED), 2),
    "review action": Target(action_of, _text(REDRAW), 2),
    "diagnosis": Target(_file("diagnosis.json", _answers), _text(ANSWER), 1),
    "radius map": Target(_file("radius_map.npz", read_wall_map), _map, 0.1),
    "cloud": Target(_file("cloud.ply", lambda f: read_wall_points(f.parent)), _cloud, 0.1),
    "video mkv": Target(_file("frames.mkv", open_video), _good("folder", "frames.mkv"), 0.02),
    "video mp4": Target(_file("frames.mp4", open_video), _good("h264", "frames.mp4"), 0.02),
    "ros1 bag": Target(_beside("ros1", "run.bag"), _good("ros1", "run.bag"), 0.01),
    "ros2 bag": Target(_beside("ros2", "run/run.db3"), _good("ros2", "run/run.db3"), 0.01),
    "ros2 metadata": Target(_beside("ros2", "run/metadata.yaml"), _good("ros2", "run/metadata.yaml"), 0.01),
    "picture": Target(_pictures, _good("images", "frames/000001.png"), 0.05),
    "mcap": Target(_beside("mcap", "run.mcap"), _good("mcap", "run.mcap"), 0.01),
}
