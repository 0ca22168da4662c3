"""Writes the recording of a scene and, in a separate folder, its truth."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
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
from pipeline.simulator.build import plain_truth
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import switches_from_mapping
from pipeline.simulator.premises import Premise
from pipeline.simulator.premises.check import require_recording, require_scene
from pipeline.simulator.render import Renderer, renderer_of
from pipeline.simulator.scene import Scene
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.truth_files import seal_truth, write_truth

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
    """Return the section ``pipe`` without unknown entries."""
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


@dataclass(frozen=True)
class Places:
    """Folders of a recording and its truth; ``sealed``: the recording contains hashes of its truth."""

    recording: Path
    truth: Path
    sealed: bool = False


def beside(recording: Path) -> Path:
    """Return the default folder of a recording's truth: beside the recording, never inside."""
    return recording.with_name(f"{recording.name}-truth")


@dataclass(frozen=True)
class Order:
    """A scene, the file that it was read from, and its output folders.

    A photograph of the scene is searched beside that file.
    """

    scene: Scene
    file: Path
    places: Places


def produce(orders: Sequence[Order], progress: Callable[[Order, int], None]) -> list[tuple[Premise, ...]]:
    """Render recordings that belong together, each with its truth; return what was checked of each.

    All scenes are checked before the first is rendered. Where one cannot be rendered, none is left.

    Parameters
    ----------
    orders : sequence of Order
    progress : callable
        Called with an order and the number of its frames that are done.

    Raises
    ------
    InputError
        When a scene or a place cannot be used.
    UnusableError
        When a scene cannot show its effects.
    """
    for order in orders:
        _require_apart(order.places)
    checked = [_checked(order) for order in orders]
    with ExitStack() as stack:
        new = [stack.enter_context(_whole_or_nothing(order.places)) for order in orders]
        return [
            _rendered(order, one, places, progress)
            for order, one, places in zip(orders, checked, new, strict=True)
        ]


@dataclass(frozen=True)
class _Checked:
    """A scene that can be rendered, with the results of its checks."""

    truth: SceneTruth
    renderer: Renderer
    premises: tuple[Premise, ...]


def _checked(order: Order) -> _Checked:
    plain = plain_truth(order.scene, order.file)
    switches = switches_from_mapping(order.scene.effects, order.file)
    truth = switch_on(plain, switches)
    renderer = renderer_of(truth)
    return _Checked(truth, renderer, tuple(require_scene(plain, switches, renderer)))


def _rendered(
    order: Order, one: _Checked, new: Places, progress: Callable[[Order, int], None]
) -> tuple[Premise, ...]:
    """Render a scene, check the recording, write its truth, and seal it."""
    scene = order.scene
    write_recording(
        one.renderer, new.recording, scene.codec, scene.quality, lambda done, _: progress(order, done)
    )
    premises = (*one.premises, *require_recording(new.recording, one.truth))
    write_truth(scene, one.truth, [p.record for p in premises], new.truth)
    if new.sealed:
        seal_truth(new.truth, new.recording)
    return premises


@contextmanager
def _whole_or_nothing(places: Places) -> Iterator[Places]:
    """Yield temporary folders, which get their final names at the end and are removed on any failure."""
    new = replace(places, recording=_partial(places.recording), truth=_partial(places.truth))
    pairs = ((new.recording, places.recording), (new.truth, places.truth))
    try:
        with disk_errors_named(places.recording):
            for part, _ in pairs:
                shutil.rmtree(part, ignore_errors=True)
            yield new
            for part, whole in pairs:
                if whole.exists():
                    whole.rmdir()
                part.rename(whole)
    finally:
        for part, _ in pairs:
            shutil.rmtree(part, ignore_errors=True)


def _partial(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.partial")


def _require_apart(places: Places) -> None:
    inside, outside = places.truth.resolve(), places.recording.resolve()
    if inside == outside or outside in inside.parents:
        raise InputError(
            places.truth, "lies inside the recording, where the truth would go out with it",
            hint="name a folder beside it with --truth",
        )  # fmt: skip
    for folder in (places.recording, places.truth):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(folder, "is there already", expected="a folder that is not there, or empty")
