"""Results on disk, one folder each. The manifest is written last: if it is complete, so is the result."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.files.codec import CodecError, Json, canonical, decode, encode
from pipeline.files.disk import FileRecord, disk_errors_named, remove, replace_json, sync_folder, write_synced
from pipeline.files.json_yaml import read_json
from pipeline.machine.outcome import Number

_FORMAT = 1
_MANIFEST = "manifest.json"
# From 4 MiB on an array that is read back is mapped from its file.
_MAP_FROM_BYTES = 1 << 22


@dataclass(frozen=True)
class Provenance:
    """Origin of a result: the stage, its time in s and its reported numbers."""

    stage: str
    version: str
    key: str
    seconds: float
    numbers: tuple[Number, ...]


@dataclass(frozen=True)
class Stored:
    """A result read back, its arrays read-only, the big ones mapped from the file."""

    artefact: Any
    provenance: Provenance


@dataclass(frozen=True)
class Store:
    """Results below ``folder``, each in ``<stage>-<first 12 digits of its key>``."""

    folder: Path

    def write(self, artefact: object, provenance: Provenance) -> None:
        """Store a result.

        Raises
        ------
        InputError
            When the disk is full or cannot be written; nothing is left that could be taken as whole.
        TypeError
            When the artefact has a field that cannot be stored.
        """
        tree, arrays = encode(artefact)
        same = _alike(arrays)
        own = {name: array for name, array in arrays.items() if name not in same}
        final = self._place(provenance.stage, provenance.key)
        temporary = self.folder / f".new-{final.name}"
        with disk_errors_named(self.folder):
            try:
                files = _write_arrays(temporary, own)
                remove(final)
                temporary.rename(final)
                sync_folder(self.folder)
                replace_json(final / _MANIFEST, _manifest(provenance, tree, files, same))
            except OSError:
                remove(temporary)
                raise

    def read(self, stage: str, key: str, kind: type) -> Stored | None:
        """Return a complete result of class ``kind``; discard an incomplete one and return None."""
        stored = self.borrow(stage, key, kind)
        if stored is None:
            self.discard(stage, key)
        return stored

    def borrow(self, stage: str, key: str, kind: type) -> Stored | None:
        """Return a complete result of class ``kind`` of another run; nothing is discarded."""
        folder = self._place(stage, key)
        try:
            manifest = _read_manifest(folder)
            _check_files(folder, manifest["files"])
            provenance = decode(manifest["provenance"], _no_array, Provenance)
            if provenance.key != key:
                raise CodecError("the result of another key")
            artefact = _artefact(folder, manifest, kind)
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return Stored(artefact, provenance)

    def look(self, stage: str, key: str, kind: type) -> Any | None:
        """Return a result for display, None when it is not complete.

        Sizes are checked, not contents, and nothing is discarded: a run may be using the folder.
        """
        folder = self._place(stage, key)
        try:
            manifest = _read_manifest(folder)
            made = decode(manifest["provenance"], _no_array, Provenance)
            whole = made.key == key and self.has(stage, key)
            return _artefact(folder, manifest, kind) if whole else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def has(self, stage: str, key: str) -> bool:
        """Return whether a result exists, by manifest and sizes; `read` also checks the content."""
        folder = self._place(stage, key)
        try:
            files: Mapping[str, Any] = _read_manifest(folder)["files"]
            return all(FileRecord(**r).has_size_of(folder / n) for n, r in files.items())
        except (OSError, ValueError, KeyError, TypeError):
            return False

    def discard(self, stage: str, key: str) -> None:
        """Remove a result, if it exists."""
        with disk_errors_named(self.folder):
            remove(self._place(stage, key))

    def sweep(self) -> None:
        """Remove remains of interrupted writes."""
        with disk_errors_named(self.folder):
            for path in self.folder.glob(".new-*"):
                remove(path)

    def _place(self, stage: str, key: str) -> Path:
        return self.folder / f"{stage}-{key[:12]}"


def _alike(arrays: Mapping[str, NDArray[Any]]) -> dict[str, str]:
    """Return the earlier name of each array that is stored under two names."""
    first: dict[int, str] = {}
    names = {name: first.setdefault(id(array), name) for name, array in arrays.items()}
    return {name: earlier for name, earlier in names.items() if name != earlier}


def _write_arrays(folder: Path, arrays: Mapping[str, NDArray[Any]]) -> dict[str, FileRecord]:
    remove(folder)
    folder.mkdir()  # not its parents: a run folder removed meanwhile would come back without the rest
    files = {f"{name}.npy": _write_array(folder / f"{name}.npy", a) for name, a in sorted(arrays.items())}
    sync_folder(folder)
    return files


def _write_array(path: Path, array: NDArray[Any]) -> FileRecord:
    return write_synced(path, lambda w: np.lib.format.write_array(w, array, allow_pickle=False))


def _artefact(folder: Path, manifest: Mapping[str, Any], kind: type) -> Any:
    # manifests of earlier versions name no array twice
    return decode(manifest["artefact"], partial(_load, folder, manifest.get("same", {})), kind)


def _load(folder: Path, same: Mapping[str, str], name: str) -> NDArray[Any]:
    path = folder / f"{same.get(name, name)}.npy"
    if path.stat().st_size >= _MAP_FROM_BYTES:
        return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))
    array: NDArray[Any] = np.load(path, allow_pickle=False)
    array.setflags(write=False)
    return array


def _manifest(
    provenance: Provenance, tree: Json, files: Mapping[str, FileRecord], same: Mapping[str, str]
) -> Json:
    content: dict[str, Json] = {
        "format": _FORMAT,
        "provenance": encode(provenance).tree,
        "files": {name: {"bytes": r.bytes, "sha256": r.sha256} for name, r in files.items()},
        "same": dict(same),
        "artefact": tree,
    }
    return {**content, "sha256": hashlib.sha256(canonical(content)).hexdigest()}


def _read_manifest(folder: Path) -> dict[str, Any]:
    manifest: dict[str, Any] = read_json(folder / _MANIFEST)
    if not isinstance(manifest, dict) or manifest.get("format") != _FORMAT:
        raise CodecError("a manifest of another format")
    stated = manifest.pop("sha256", "")
    if hashlib.sha256(canonical(manifest)).hexdigest() != stated:
        raise CodecError("a damaged manifest")
    return manifest


def _check_files(folder: Path, files: Mapping[str, Any]) -> None:
    for name, record in files.items():
        if not FileRecord(**record).matches(folder / name):
            raise CodecError(f"{name} is damaged")


def _no_array(name: str) -> NDArray[Any]:
    raise CodecError(f"unexpected array {name}")
