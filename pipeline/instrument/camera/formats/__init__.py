"""Camera files of other programs: each format recognises its own files and says why it refuses others."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.formats import kalibr, ocamcalib, opencv
from pipeline.instrument.camera.formats.document import NATIVE_FORMAT, CameraDocument, CameraFormat

FORMATS: tuple[CameraFormat, ...] = (
    NATIVE_FORMAT, opencv.FORMAT, kalibr.KALIBR_FORMAT, kalibr.CAMODOCAL_FORMAT, ocamcalib.FORMAT,
)  # fmt: skip
WRITTEN = tuple(format_.name for format_ in FORMATS if format_.write is not None)


def read_camera(path: Path) -> Camera:
    """Return the camera of a calibration file of any known format.

    Raises
    ------
    InputError
        When the file cannot be read, is of no known format (saying what was tried and why each refused),
        or is of a known one but does not hold a usable camera.
    """
    document = CameraDocument.open(path)
    refusals = []
    for format_ in FORMATS:
        refusal = format_.refusal(document)
        if not refusal:
            return format_.read(document)
        refusals.append(f"  {format_.name}: {refusal}")
    raise InputError(path, "is not a camera file of a known format. Tried:\n" + "\n".join(refusals))


def write_camera(camera: Camera, path: Path, format_name: str) -> None:
    """Write a camera in the named format, one of `WRITTEN`.

    Raises
    ------
    InputError
        When the format does not exist or cannot hold this camera model.
    """
    writers = {format_.name: format_.write for format_ in FORMATS if format_.write is not None}
    if format_name not in writers:
        raise InputError(path, f"unknown camera format {format_name!r}", expected=", ".join(writers))
    path.write_text(writers[format_name](camera, path), "utf-8")
