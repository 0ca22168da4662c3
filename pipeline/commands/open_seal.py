"""``boresight open-seal``: checks that a truth belongs to a recording and is unchanged since the sealing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from pipeline.errors import InputError
from pipeline.simulator.truth_files import open_seal as compare


def open_seal(
    recording: Annotated[Path, typer.Argument(help="Recording that simulate --seal wrote.")],
    truth: Annotated[Path, typer.Argument(help="Folder of its truth.")],
) -> None:
    """Verify that truth and recording are unchanged since the sealing, and print the concealed effects."""
    files = compare(recording, truth)
    for file in files:
        typer.echo(f"{file.file:<36} {file.problem or 'as sealed'}")
    broken = [f"{f.file} {f.problem}" for f in files if f.problem]
    if broken:
        raise InputError(
            recording, f"does not agree with its seal: {'; '.join(broken)}",
            hint="the recording or its truth was changed after it was sealed, or they do not belong together",
        )  # fmt: skip
    effects = json.loads((truth / "truth.json").read_text("utf-8"))["effects"]
    concealed = ", ".join(f"{name} {' '.join(f'{v:g}' for v in values)}" for name, values in effects)
    typer.echo(f"Concealed: {concealed or 'nothing'}")
