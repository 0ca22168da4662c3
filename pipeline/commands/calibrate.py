"""``boresight calibrate``: camera and laser sheet, with covariance, from a gauge run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from pipeline.api import calibrate as calibration
from pipeline.commands import Assignments, ConfigFile, ResultFolder, StatedProbe
from pipeline.machine.display import ProgressDisplay, print_warnings
from stages.calibrate.gauge import GaugeCalibration


def calibrate(
    gauge: Annotated[Path, typer.Argument(help="recording of a run through a gauge")],
    output: ResultFolder,
    probe: StatedProbe = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Find camera and laser sheet, with covariance, from a gauge run.

    Writes probe.yaml, which `boresight run --probe` takes, calibration.json and calibration.html.
    """
    console = Console(stderr=True)
    with ProgressDisplay(console) as display:
        done = calibration.calibrate(
            gauge, output, probe=probe, config=config, settings=assignments or (), display=display
        )
    print_warnings(done.warnings, console)
    _show(done.result, output, console)


def _show(result: GaugeCalibration, output: Path, console: Console) -> None:
    table = Table(title=f"Calibrated on {result.name}")
    for heading in ("parameter", "value", "1 σ", "change", "in stated σ"):
        table.add_column(heading)
    sigma, stated = (np.sqrt(np.diag(p.covariance)) for p in (result.probe, result.stated))
    change = result.probe.parameters - result.stated.parameters
    for k, name in enumerate(result.probe.parameter_names):
        if sigma[k] > 0:
            moved = f"{change[k] / stated[k]:+.1f}" if stated[k] > 0 else "not stated"
            value = f"{result.probe.parameters[k]:.6g}"
            table.add_row(name, value, f"{sigma[k]:.2g}", f"{change[k]:+.3g}", moved)
    console.print(table)
    if len(result.wrong_fiducials):
        console.print(
            f"left out, not where the recording says: fiducials {', '.join(map(str, result.wrong_fiducials))}"
        )
    if len(result.wrong_rings):
        console.print(f"left out, not on the bore: rings of frames {', '.join(map(str, result.wrong_rings))}")
    console.print(f"Probe: {output / 'probe.yaml'}   Report: {output / 'calibration.html'}")
