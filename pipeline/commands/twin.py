"""``boresight twin``: recorded frames of a run beside the same frames, re-rendered."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from pipeline.api.diagnosis.simulated import DiagnosisTried
from pipeline.api.job import result_of, run_shown
from pipeline.api.twin import TwinOf, psnr_without_noise, twin_job
from pipeline.artefacts.twin import Twin
from pipeline.commands import Assignments, ResultFolder
from pipeline.machine.display import ProgressDisplay


def twin(
    run: Annotated[Path, typer.Argument(help="run folder, best of a run with --set premises.withhold=10")],
    output: ResultFolder,
    diagnosis: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="diagnosis whose corrected probe takes the place of the run's"),
    ] = None,
    assignments: Assignments = None,
) -> None:
    """Re-render frames from what a run has measured, and say where and why the recorded ones differ.

    Writes twin.json and twin.html. Frames tell most when the run was told to withhold them from measurement.
    """
    console = Console(stderr=True)
    with ProgressDisplay(console) as display:
        job = twin_job(run, output, diagnosis, assignments or (), display)
    again = job.source(TwinOf).again
    if again:
        typer.echo(
            f"{run} was made by another version of the program or with other parameters; computed again: "
            + ", ".join(again)
        )
    run_shown(job, console)
    _show_gauge(job.source(DiagnosisTried))
    _show(result_of(job, Twin), output)


def _show_gauge(tried: DiagnosisTried) -> None:
    if tried.gauge is not None:
        stated, diagnosed = tried.gauge.chi2_stated, tried.gauge.chi2_diagnosed
        typer.echo(
            f"line of the gauge run: χ² per pixel {stated:.2f} as stated, {diagnosed:.2f} as diagnosed"
        )
    for mismatch in (*tried.found, *tried.withdrawn):
        typer.echo(mismatch.statement)


def _show(found: Twin, output: Path) -> None:
    kind = "withheld" if found.withheld else "measured"
    typer.echo(f"{len(found.frame)} {kind} frames compared")
    typer.echo(f"{'region':<14}{'pixels':>12}{'χ² before':>12}{'after':>10}")
    for r in found.regions:
        if math.isnan(r.chi2_after):
            typer.echo(f"{r.name:<14}{r.pixels:>12}  not compared")
            continue
        typer.echo(f"{r.name:<14}{r.pixels:>12}{r.chi2_before:>12.2f}{r.chi2_after:>10.2f}")
    typer.echo(f"lit wall by the camera's noise alone: χ² per pixel {found.chi2_camera:.2f}")
    typer.echo(f"lit wall: {_psnr(found)}")
    for mismatch in found.found:
        typer.echo(f"found: {mismatch.name or 'without a name'}: {mismatch.statement}")
    typer.echo(f"Page: {output / 'twin.html'}")


def _psnr(found: Twin) -> str:
    """Return in words by how much recorded and re-rendered wall differ."""
    beyond = psnr_without_noise(found)
    if not math.isfinite(found.psnr_db):
        return beyond
    known = math.isfinite(found.psnr_noise_free_db)
    return f"{found.psnr_db:.1f} dB, {'without the noise ' if known else ''}{beyond}"
