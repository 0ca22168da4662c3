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
PriorFile = Annotated[
    Path, typer.Option(metavar="FILE", help="prior to draw from: a file, or the name of a shipped one")
]
PipeDiameter = Annotated[float, typer.Option(help="inner diameter of the pipe, mm")]
OffsetRight = Annotated[float, typer.Option(help="offset of the probe from the pipe's axis, right, mm")]
OffsetDown = Annotated[float, typer.Option(help="offset of the probe from the pipe's axis, down, mm")]
BoardColumns = Annotated[
    int, typer.Option(min=3, max=100, help="chessboard: inner corners along a row; charuco: squares")
]
BoardRows = Annotated[
    int, typer.Option(min=3, max=100, help="chessboard: inner corners along a column; charuco: squares")
]
SquareEdge = Annotated[float, typer.Option(min=0.01, help="edge of a square, mm")]
MarkerEdge = Annotated[float | None, typer.Option(min=0.01, help="charuco: edge of a marker, mm")]
MarkerDictionary = Annotated[str, typer.Option(help="charuco: OpenCV's marker dictionary")]
