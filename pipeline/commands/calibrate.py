"""``boresight calibrate``: camera and laser sheet, with covariance, from a gauge run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import yaml
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from pipeline.errors import InputError
from pipeline.files.codec import digest
from pipeline.files.disk import require_writable, written_together
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe, write_probe
from pipeline.machine.stage import quiet_context
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.checks import check_probe_fits, refuse_changed
from stages.calibrate.gauge.calibrate import calibrate_gauge
from stages.calibrate.gauge.parameters import GaugeParameters
from stages.calibrate.gauge.premises import require_gauge
from stages.calibrate.gauge.result import GaugeCalibration
from stages.rings import RingParameters, extract_rings


def calibrate(
    gauge: Annotated[Path, typer.Argument(help="recording of a run through a gauge")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="folder for the results")],
    probe: Annotated[
        Path | None, typer.Option(metavar="FILE", help="stated probe, in place of the recording's own")
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="one parameter, such as tilt_prior_deg=1.0"),
    ] = None,
) -> None:
    """Find camera and laser sheet, with covariance, from a gauge run.

    Writes probe.yaml, which `boresight run --probe` takes, calibration.json and calibration.html.
    """
    parameters = gauge_parameters(assignments or ())
    recording = open_recording(gauge)
    stated = _stated_probe(recording, probe)
    require_gauge(recording)
    require_writable(output)
    console = Console(stderr=True)
    with console.status("measuring rings"):
        rings = extract_rings(recording, stated, RingParameters.model_validate({}), quiet_context())
    with console.status("measuring fiducials, adjusting"):
        result = calibrate_gauge(recording, rings, stated, parameters, quiet_context())
    refuse_changed(recording)
    inputs = {"gauge": recording.content_key, "probe": digest(stated)}
    made_by = MadeBy("calibrate", inputs, parameters.model_dump(mode="json"))
    # matplotlib takes a second to load, for which a refusal need not wait
    from pipeline.commands.calibrate_report import write_report

    with written_together(output, last="probe.yaml") as folder:
        write_probe(result.probe, folder / "probe.yaml", made_by)
        write_report(result, made_by, folder)
    _show(result, output, console)


def gauge_parameters(assignments: Sequence[str]) -> GaugeParameters:
    """Return the parameters with some set as ``NAME=VALUE``.

    Raises
    ------
    InputError
        For an unknown name or a value out of range.
    """
    values: dict[str, object] = {}
    for assignment in assignments:
        name, _, value = assignment.partition("=")
        if name not in GaugeParameters.model_fields:
            raise InputError(
                "--set", f"{name!r} is no parameter", expected=", ".join(GaugeParameters.model_fields)
            )
        number = yaml.safe_load(value)
        wanted = GaugeParameters.model_fields[name].annotation
        values[name] = float(number) if wanted is float and isinstance(number, int) else number
    try:
        return GaugeParameters.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError("--set", f"{first['loc'][0]}: {first['msg']}") from error


def _stated_probe(recording: Recording, probe: Path | None) -> Probe:
    file = probe or recording.probe_file
    if file is None:
        raise InputError(recording.path, "names no probe", hint="give one with --probe FILE")
    stated = read_probe(file)
    check_probe_fits(recording, stated)
    return stated


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
