"""What a result was made by, and from which inputs: written into every result beside a run's own record."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from types import MappingProxyType

from pipeline.files.codec import Json, canonical
from pipeline.files.installed import program_version

# What computes; another version of these may change a result's last digits.
_LIBRARIES = (
    "av", "matplotlib", "numba", "numpy", "open3d", "opencv-contrib-python-headless", "pillow", "pyfqmr",
    "pymeshlab", "scipy", "xatlas", "zarr",
)  # fmt: skip


@dataclass(frozen=True)
class MadeBy:
    """A command with what it was given.

    Attributes
    ----------
    command : str
        Of boresight.
    inputs : mapping of str to str
        SHA-256 by what the input is; recordings and probes as in ``input_sha256`` of run.json.
    settings : mapping of str to JSON
        Parameters of the command.
    """

    command: str
    inputs: Mapping[str, str]
    settings: Mapping[str, Json] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """SHA-256 of the command with what it was given."""
        content: Json = [self.command, dict(self.inputs), dict(self.settings)]
        return hashlib.sha256(canonical(content)).hexdigest()

    def document(self) -> dict[str, Json]:
        """Return all as plain data, with the versions of the program and its libraries."""
        return {
            "program": {"name": "boresight", "version": program_version()},
            "command": self.command,
            "input_sha256": dict(self.inputs),
            "settings": dict(self.settings),
            "libraries": dict(library_versions()),
        }


@cache
def library_versions() -> Mapping[str, str]:
    """Return the versions of Python and of the libraries that compute."""
    found = {"python": platform.python_version()} | {name: version(name) for name in _LIBRARIES}
    return MappingProxyType(found)
