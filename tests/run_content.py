"""What two runs of the same recording must have in common: the bytes of every file that contains no times."""

from __future__ import annotations

import hashlib
from pathlib import Path

# The record of a call and the report contain times.
_DATED = ("run.json", "report.html", "batch.json", "batch.html")


def run_content(output: Path) -> dict[str, str]:
    """Return the SHA-256 of every file of a run, or of a batch of runs, by its path below that folder."""
    files = (p for p in output.rglob("*") if p.is_file() and ".boresight" not in p.parts)
    return {
        p.relative_to(output).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in files
        if p.name not in _DATED
    }
