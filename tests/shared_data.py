"""Where the development data is; a test that needs it is skipped, with that reason, when it is absent."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

PROJECT_ROOT = Path(__file__).resolve().parents[1]


def shared(*parts: str) -> Path:
    """Return a path below the shared folder beside the project, or skip the calling test."""
    path = PROJECT_ROOT.parent / "shared" / Path(*parts)
    if not path.exists():
        pytest.skip(f"development data {Path(*parts)} is not beside the project")
    return path


def scorer() -> ModuleType:
    """Return the scoring program of the development data."""
    spec = importlib.util.spec_from_file_location("score_run", shared("score_run.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
