"""JSON from files: no larger and no deeper than what boresight itself writes of the longest run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

LARGEST_BYTES = 256 << 20


def read_json(file: Path) -> Any:
    """Return what a JSON file holds.

    Raises
    ------
    OSError
        When it cannot be read.
    ValueError
        When it is too large, not UTF-8, not JSON, or nested too deeply.
    """
    size = file.stat().st_size
    if size > LARGEST_BYTES:
        raise ValueError(f"it is {size} bytes long, more than {LARGEST_BYTES}")
    return parse_json(file.read_text("utf-8"))


def parse_json(text: str | bytes) -> Any:
    """Return what a JSON text holds; raises ValueError when it is not JSON or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
