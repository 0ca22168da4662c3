"""Where the development data lies; a test that needs it skips, saying so, when it is absent."""

from pathlib import Path

import pytest

PROJECT_ROOT = Path(__file__).resolve().parents[1]


def shared(*parts: str) -> Path:
    """Return a path below the shared folder beside the project, or skip the calling test."""
    path = PROJECT_ROOT.parent / "shared" / Path(*parts)
    if not path.exists():
        pytest.skip(f"development data {Path(*parts)} is not beside the project")
    return path
