"""What is installed: the program's version, and the files of ``configs`` that come with it.

Nothing that computes is imported, so that ``boresight --version`` answers at once.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path

from pipeline.errors import InputError


def program_version() -> str:
    """Return the version of boresight, ``unknown`` when it is not installed."""
    try:
        return version("boresight")
    except PackageNotFoundError:
        return "unknown"


# In a checkout `pipeline/configs` is a link to the folder `configs`; a wheel holds the files themselves.
_CONFIGS = Path(str(files("pipeline"))) / "configs"
_SUFFIX = ".yaml"
PARAMETERS, SCENES, PRIORS, KERNELS = "", "scenes", "priors", "kernels"


def shipped_names(kind: str) -> tuple[str, ...]:
    """Return the names of the files that are shipped.

    Parameters
    ----------
    kind : str
        `PARAMETERS`, `SCENES`, `PRIORS` or `KERNELS`.
    """
    return tuple(sorted(file.stem for file in (_CONFIGS / kind).glob(f"*{_SUFFIX}")))


def file_or_shipped(given: Path, kind: str) -> Path:
    """Return the file at ``given``, or the shipped file of that name when it is a bare name.

    A bare name has neither folder nor suffix: ``pairs`` is one, ``pairs.yaml`` and ``./pairs`` are not. A
    file that is there goes before a shipped one.

    Raises
    ------
    InputError
        When nothing of this name is shipped; names what is.
    """
    if given.exists() or given.suffix or len(given.parts) > 1:
        return given
    if given.name not in shipped_names(kind):
        raise InputError(
            given,
            f"is neither a file nor the name of one of the {kind or 'parameter files'} that are shipped",
            expected=f"a file, or one of: {', '.join(shipped_names(kind))}",
        )
    return shipped_file(given.name, kind)


def shipped_file(name: str, kind: str) -> Path:
    """Return the shipped file of a name, whatever lies in the working folder."""
    return _CONFIGS / kind / f"{name}{_SUFFIX}"
