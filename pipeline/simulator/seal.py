"""Sealing a truth: its hashes go out with the recording, so that nobody can change it before it is opened.

Each hash is SHA-256 over a random nonce and the file, so that a truth cannot be found by trying likely ones.
The nonce stays with the truth.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from pipeline.errors import InputError
from pipeline.files.yaml_file import read_yaml

SEAL_FILE = "sealed.yaml"
NONCE_FILE = "nonce.txt"
_FORMAT = 1
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Comparison:
    """Whether a file is what was sealed: ``problem`` is empty when it is."""

    file: str
    problem: str


def seal_truth(truth: Path, recording: Path) -> None:
    """Seal the files of a truth folder: hashes into the recording, the nonce into the truth.

    The recording's own files are hashed too, into the same seal, for the truth tells of them only.
    """
    nonce = secrets.token_hex(32)
    (truth / NONCE_FILE).write_text(nonce + "\n", "utf-8")
    sealed = {
        "format": _FORMAT,
        "method": f"SHA-256 of the text in {NONCE_FILE} followed by the file",
        "truth": {p.name: _hash(p, nonce) for p in _files(truth) if p.name != NONCE_FILE},
        "recording": {p.name: _hash(p, nonce) for p in _files(recording) if p.name != SEAL_FILE},
    }
    (recording / SEAL_FILE).write_text(yaml.safe_dump(sealed, sort_keys=False), "utf-8")


def open_seal(recording: Path, truth: Path) -> tuple[Comparison, ...]:
    """Return for every sealed file, and every file that was not sealed, whether it is as it was sealed.

    Raises
    ------
    InputError
        When there is no seal, no nonce to check it with, or a file cannot be read.
    """
    try:
        return _opened(recording, truth)
    except (OSError, UnicodeDecodeError) as error:
        file = error.filename if isinstance(error, OSError) else truth / NONCE_FILE
        raise InputError(
            Path(file or recording), f"cannot be read: {error}", expected="a sealed file that may be read",
            hint="mend its permissions, or copy recording and truth again, whole",
        ) from error  # fmt: skip


def _opened(recording: Path, truth: Path) -> tuple[Comparison, ...]:
    seal = read_yaml(recording / SEAL_FILE)
    if seal.integer("format", least=1) != _FORMAT:
        raise seal.fail("format", "is of another version", str(_FORMAT))
    nonce = _nonce(truth)
    parts = ((truth, "truth", NONCE_FILE), (recording, "recording", SEAL_FILE))
    return tuple(
        compared
        for folder, key, apart in parts
        for compared in _compared(folder, key, seal.section(key).values, nonce, apart)
    )


def _compared(
    folder: Path, key: str, sealed: Mapping[str, object], nonce: str, apart: str
) -> list[Comparison]:
    there = {p.name for p in _files(folder)} - {apart}
    found = []
    for name in sorted(there | set(sealed)):
        if name not in there:
            problem = "is sealed but not there"
        elif name not in sealed:
            problem = "is there but was not sealed"
        else:
            problem = "" if _hash(folder / name, nonce) == sealed[name] else "is not what was sealed"
        found.append(Comparison(f"{key}/{name}", problem))
    return found


def _nonce(truth: Path) -> str:
    file = truth / NONCE_FILE
    if not file.is_file():
        raise InputError(
            file, "is missing, and without it no hash can be checked",
            hint="give the folder that simulate --seal wrote the truth to",
        )  # fmt: skip
    return file.read_text("utf-8").strip()


def _hash(path: Path, nonce: str) -> str:
    total = hashlib.sha256(nonce.encode())
    with path.open("rb") as stream:
        while chunk := stream.read(_CHUNK):
            total.update(chunk)
    return total.hexdigest()


def _files(folder: Path) -> list[Path]:
    """Return the plain files of a folder, by name; those of sub-folders by their own names are not used."""
    return sorted(p for p in folder.iterdir() if p.is_file())
