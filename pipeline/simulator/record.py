"""Writes a rendered recording: video, frames.csv, encoder.csv, probe.yaml, recording.yaml."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path

import av
import cv2
import yaml
from av.container import OutputContainer
from av.video.stream import VideoStream

from pipeline.arrays import Image
from pipeline.errors import InputError
from pipeline.files.disk import disk_errors_named
from pipeline.instrument.probe_file import write_probe
from pipeline.recording.base import Encoder, FrameTable, PipeFacts
from pipeline.simulator.render import Renderer
from pipeline.simulator.truth import SceneTruth

Codec = str
_VIDEO = {"h264": "frames.mkv", "ffv1": "frames.mkv", "png": "frames/%06d.png"}


def write_recording(
    renderer: Renderer, folder: Path, codec: Codec, quality: int, progress: Callable[[int, int], None]
) -> None:
    """Render every frame of a scene into a recording's folder, which must not be there yet.

    Raises
    ------
    InputError
        When the folder is not empty or cannot be written.
    """
    truth = renderer.truth
    if folder.exists() and any(folder.iterdir()):
        raise InputError(folder, "is not empty", expected="a folder that is not there yet")
    with disk_errors_named(folder):
        folder.mkdir(parents=True, exist_ok=True)
        _write_tables(truth, folder, _VIDEO[codec])
        write_video(renderer.frames(truth.frames.frame.tolist()), truth, folder, codec, quality, progress)


def write_video(
    images: Iterable[Image], truth: SceneTruth, folder: Path, codec: Codec, quality: int,
    progress: Callable[[int, int], None],
) -> None:  # fmt: skip
    """Store frames (H, W, 3) BGR one after another."""
    total = len(truth.frames.frame)
    if codec == "png":
        (folder / "frames").mkdir()
        for number, image in enumerate(images):
            cv2.imwrite(str(folder / (_VIDEO[codec] % number)), image)
            progress(number + 1, total)
        return
    with av.open(str(folder / _VIDEO[codec]), "w") as container:
        stream = _video_stream(container, truth, codec, quality)
        for number, image in enumerate(images):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
            progress(number + 1, total)
        container.mux(stream.encode())


def _video_stream(container: OutputContainer, truth: SceneTruth, codec: Codec, quality: int) -> VideoStream:
    rate = Fraction(truth.frame_rate).limit_denominator(1001)
    if codec == "h264":
        stream = container.add_stream("libx264", rate, {"crf": str(quality), "preset": "fast"})
        stream.pix_fmt = "yuv444p"
    else:
        stream = container.add_stream("ffv1", rate, {"slicecrc": "1"})
        stream.pix_fmt = "bgr0"
    stream.width, stream.height = truth.instrument.camera.model.image_size
    return stream


def _write_tables(truth: SceneTruth, folder: Path, video: str) -> None:
    encoder = truth.encoder()
    (folder / "frames.csv").write_text(_frames_text(truth.frames), "utf-8")
    if encoder is not None:
        (folder / "encoder.csv").write_text(_encoder_text(encoder), "utf-8")
    write_probe(truth.stated, folder / "probe.yaml")
    description: dict[str, object] = {
        "name": truth.name, "kind": truth.kind, "video": video, "frames": "frames.csv",
        "frame_rate": truth.frame_rate,
    }  # fmt: skip
    if encoder is not None:
        description["encoder"] = "encoder.csv"
    description |= {"probe": "probe.yaml", "pipe": _facts(truth.facts)}
    _write_yaml(description, folder / "recording.yaml")


def _frames_text(table: FrameTable) -> str:
    rows = zip(table.frame.tolist(), table.time_s.tolist(), table.illumination.tolist(), strict=True)
    return "frame,time_s,illumination\n" + "".join(f"{n},{t:.6f},{light}\n" for n, t, light in rows)


def _encoder_text(encoder: Encoder) -> str:
    rows = zip(encoder.time_s.tolist(), encoder.distance_mm.tolist(), strict=True)
    return "time_s,distance_mm\n" + "".join(f"{t:.4f},{d:.3f}\n" for t, d in rows)


def _facts(facts: PipeFacts) -> dict[str, object]:
    """Return the section ``pipe``, without what is not known."""
    section: dict[str, object] = {"nominal_diameter_mm": facts.nominal_diameter_mm}
    if facts.wall_thickness_mm is not None:
        section["wall_thickness_mm"] = facts.wall_thickness_mm
    if facts.bore:
        section |= {"bore": [asdict(b) for b in facts.bore], "bore_tolerance_mm": facts.bore_tolerance_mm}
    if facts.fiducials is not None:
        section["fiducials"] = {
            **asdict(facts.fiducials), "markers": [asdict(m) for m in facts.fiducials.markers]
        }  # fmt: skip
    return section


def _write_yaml(document: dict[str, object], file: Path) -> None:
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=100, allow_unicode=True)
    file.write_text(text, "utf-8")
