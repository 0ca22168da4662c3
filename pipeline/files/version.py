"""The program's version, without importing what computes: ``boresight --version`` shall answer at once."""

from importlib.metadata import PackageNotFoundError, version


def program_version() -> str:
    """Return the version of boresight, ``unknown`` when it is not installed."""
    try:
        return version("boresight")
    except PackageNotFoundError:
        return "unknown"
