"""One module for each command, which `pipeline.cli` attaches by name; here are the common options."""

from pathlib import Path
from typing import Annotated

import typer

ConfigFile = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="parameters (YAML); see: boresight config")
]
Assignments = Annotated[
    list[str] | None, typer.Option("--set", metavar="STAGE.NAME=VALUE", help="one parameter; may be repeated")
]
ResultFolder = Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="folder for the results")]
StatedProbe = Annotated[
    Path | None, typer.Option(metavar="FILE", help="stated probe, in place of the recording's own")
]
