"""The recordings below a folder."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError

_BAGS = (".bag", ".mcap")


def find_recordings(folder: Path) -> dict[str, Path]:
    """Return all recordings below a folder by a name that is also fit for a folder.

    Raises
    ------
    InputError
        When there is none, or the folder cannot be read.
    """
    if not folder.is_dir():
        raise InputError(folder, "is not a folder", expected="a folder of recordings")
    found = sorted({p.parent for p in folder.rglob("recording.yaml")})
    found += sorted(p for p in folder.rglob("*") if p.suffix in _BAGS and p.is_file())
    found += sorted({p.parent for p in folder.rglob("metadata.yaml")} - set(found))
    if not found:
        raise InputError(folder, "holds no recordings", expected="recording folders, ROS bags or MCAP files")
    return {_name(p, folder): p for p in found}


def _name(path: Path, folder: Path) -> str:
    parts = path.relative_to(folder).parts
    return "-".join(parts) if parts else folder.name
