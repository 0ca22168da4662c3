"""``boresight calibrate``: camera and laser sheet, with covariance, from a gauge run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from pipeline.api.job import open_job, result_of
from pipeline.commands.working import Assignments, ConfigFile, worked
from pipeline.files.disk import require_writable
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe_file import write_probe
from pipeline.machine.configuration import resolve
from pipeline.machine.exporter import Exporter
from stages.calibrate.gauge import GAUGE, GaugeCalibration, require_gauge
from stages.premises import PREMISES
from stages.rings import RINGS

STAGES = (PREMISES, RINGS, GAUGE)


def calibrate(
    gauge: Annotated[Path, typer.Argument(help="recording of a run through a gauge")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="folder for the results")],
    probe: Annotated[
        Path | None, typer.Option(metavar="FILE", help="stated probe, in place of the recording's own")
    ] = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Find camera and laser sheet, with covariance, from a gauge run.

    Writes probe.yaml, which `boresight run --probe` takes, calibration.json and calibration.html.
    """
    configuration = resolve(STAGES, config, assignments or ())
    job = open_job(gauge, output, probe, STAGES, EXPORTERS, configuration, "calibrate")
    require_gauge(job.recording)
    require_writable(output)
    console = Console(stderr=True)
    worked(job, console)
    _show(result_of(job, GaugeCalibration), output, console)


def write_calibration(result: GaugeCalibration, made_by: MadeBy, folder: Path) -> None:
    """Write probe.yaml, calibration.json and calibration.html."""
    # matplotlib takes a second to load, for which a refusal need not wait
    from pipeline.commands.calibrate_report import write_report

    write_probe(result.probe, folder / "probe.yaml", made_by)
    write_report(result, made_by, folder)


EXPORTERS = (Exporter("calibration", write_calibration),)


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
        console.print(f"outvoted fiducials: {', '.join(map(str, result.wrong_fiducials))}")
    if len(result.wrong_rings):
        console.print(f"outvoted rings, frames: {', '.join(map(str, result.wrong_rings))}")
    console.print(f"Probe: {output / 'probe.yaml'}   Report: {output / 'calibration.html'}")
