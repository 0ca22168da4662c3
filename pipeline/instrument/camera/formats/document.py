"""A calibration file opened once for all formats, the interface of a format, and the program's own format.

The program's own camera file is the ``camera:`` section of probe.yaml, alone or with the rest.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import yaml

from pipeline.errors import InputError
from pipeline.files.json_yaml import LARGEST_YAML_BYTES, Section, parse_yaml
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.mapping import camera_from_mapping, camera_to_mapping


@dataclass(frozen=True)
class CameraDocument:
    """The text of a file, and its YAML content where it is YAML."""

    file: Path
    text: str

    @staticmethod
    def open(path: Path) -> CameraDocument:
        """Read a text file.

        Raises
        ------
        InputError
            When it is absent, a folder, too large or not text.
        """
        try:
            if path.stat().st_size > LARGEST_YAML_BYTES:
                raise InputError(path, f"is larger than {LARGEST_YAML_BYTES} bytes", expected="a camera file")
            return CameraDocument(path, path.read_text("utf-8-sig"))
        except OSError as error:
            raise InputError(path, f"cannot be read ({error.strerror})", expected="a camera file") from error
        except UnicodeDecodeError as error:
            raise InputError(path, "is not text", expected="a camera file, which is text") from error

    @cached_property
    def yaml(self) -> Section | str:
        """The YAML content, or why there is none.

        OpenCV's ``%YAML:1.0`` line and ``!!opencv-matrix`` tag are not YAML and are removed first.
        """
        text = re.sub(r"\A%YAML[^\n]*", "", self.text).replace("!!opencv-matrix", "")
        try:
            return parse_yaml(text, self.file)
        except InputError as error:
            return str(error).splitlines()[0].removeprefix(f"{self.file}: ").removeprefix(f"{self.file}, ")

    @property
    def section(self) -> Section:
        """The YAML content of a document that a format has recognised as YAML."""
        if isinstance(self.yaml, str):
            raise InputError(self.file, self.yaml)
        return self.yaml

    def lacks(self, *keys: str) -> str:
        """Return why this is not a YAML mapping with all of ``keys``, or an empty string."""
        if isinstance(self.yaml, str):
            return self.yaml
        missing = [key for key in keys if key not in self.yaml.values]
        return f"has no key {missing[0]!r}" if missing else ""


@dataclass(frozen=True)
class CameraFormat:
    """A file format of cameras.

    Attributes
    ----------
    name
        As users write it.
    refusal
        Returns why a document is not of this format, or an empty string when it is.
    read
        Returns the camera of a recognised document, or raises `InputError`.
    write
        Returns the file's text for a camera; the path is named in errors. None when the format is only read.
    """

    name: str
    refusal: Callable[[CameraDocument], str]
    read: Callable[[CameraDocument], Camera]
    write: Callable[[Camera, Path], str] | None = None


def cannot_hold(camera: Camera, path: Path, format_name: str, holds: str) -> InputError:
    """Return the error that a format has no place for this camera."""
    return InputError(
        path,
        f"{format_name} cannot hold a {camera.model} camera",
        expected=holds,
        hint="write another format, or calibrate a model that this one has",
    )


def _refusal(document: CameraDocument) -> str:
    return document.lacks("camera")


def _read(document: CameraDocument) -> Camera:
    return camera_from_mapping(document.section.section("camera").values, document.file)


def _write(camera: Camera, path: Path) -> str:
    return yaml.safe_dump({"camera": camera_to_mapping(camera)}, sort_keys=False)


NATIVE_FORMAT = CameraFormat("boresight", _refusal, _read, _write)
