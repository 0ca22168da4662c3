"""Errors meant for people: each says what is wrong, where, what was expected and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


class BoresightError(Exception):
    """Base of every error that boresight raises on purpose; its text is fit to be shown to a user."""


class InputError(BoresightError):
    """An input that cannot be used.

    Parameters
    ----------
    file
        The file or folder at fault.
    problem
        What was found.
    place
        Where in the file: a key, a line, a frame. Empty when the whole file is meant.
    expected
        What would have been right.
    hint
        What the user can do.
    """

    def __init__(
        self, file: Path | str, problem: str, *, place: str = "", expected: str = "", hint: str = ""
    ) -> None:
        self.file, self.problem, self.place, self.expected, self.hint = (
            Path(file), problem, place, expected, hint,
        )  # fmt: skip
        where = f"{file}, {place}" if place else f"{file}"
        parts = [f"{where}: {problem}"]
        if expected:
            parts.append(f"Expected: {expected}")
        if hint:
            parts.append(f"What to do: {hint}")
        super().__init__("\n".join(parts))


class UnusableError(BoresightError):
    """The input is well formed but a stage cannot make its result from it.

    Parameters
    ----------
    stage
        Name of the stage.
    problem
        What was measured.
    limit
        The limit it broke.
    frames
        The frames concerned.
    hint
        What the user can do.
    """

    def __init__(
        self, stage: str, problem: str, *, limit: str = "", frames: Sequence[int] = (), hint: str = ""
    ) -> None:
        self.stage, self.problem, self.limit, self.hint = stage, problem, limit, hint
        self.frames = tuple(frames)
        parts = [f"stage {stage}: {problem}"]
        if frames:
            shown = ", ".join(str(f) for f in self.frames[:8])
            parts.append(f"Frames: {shown}{' …' if len(self.frames) > 8 else ''} ({len(self.frames)} in all)")
        if limit:
            parts.append(f"Limit: {limit}")
        if hint:
            parts.append(f"What to do: {hint}")
        super().__init__("\n".join(parts))


class Cancelled(BoresightError):  # noqa: N818  the word users know for it
    """The user stopped the run; what was completed is kept."""
