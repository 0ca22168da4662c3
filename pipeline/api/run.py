"""A recording run from a script, as `boresight run` runs it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipeline.api.job import Job, open_job, run_job
from pipeline.api.opened import Run
from pipeline.export.catalogue import EXPORTERS
from pipeline.files.shipped import PARAMETERS, file_or_shipped
from pipeline.machine.configuration import Configuration, resolve
from pipeline.machine.display import Display, SilentDisplay
from pipeline.machine.plan import Selection
from stages.catalogue import PIPELINE


def run(
    recording: Path | str,
    folder: Path | str,
    *,
    probe: Path | str | None = None,
    config: Path | str | None = None,
    settings: Sequence[str] = (),
    from_stage: str = "",
    only: str = "",
    resume: bool = True,
    display: Display | None = None,
) -> Run:
    """Turn a recording into a run folder and return the run, opened.

    What the folder already holds of the same inputs, parameters and program is not computed again.

    Parameters
    ----------
    recording : path
        A recording's folder, or a bag.
    folder : path
        The run folder: a new one, an empty one, or that of an earlier run.
    probe : path, optional
        The probe file to use; the one that the recording names when it is left out.
    config : path or str, optional
        A file of parameters, or the name of a shipped one (`shipped_names`).
    settings : sequence of str
        Single parameters, each ``stage.name=value``; they go before those of ``config``.
    from_stage : str
        Compute this stage and all after it again.
    only : str
        Run this stage alone.
    resume : bool
        Whether to use what the folder holds; False computes everything again.
    display : Display, optional
        Is told how the stages stand; nothing is shown when it is left out.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        When the recording, the probe, a parameter or the folder cannot be used.
    UnusableError
        When the recording is well formed, but a stage cannot measure what it must.
    Cancelled
        When the user stopped it with Ctrl-C; the same call goes on where it was.
    """
    job = prepare(recording, folder, probe=probe, configuration=configuration(config, settings))
    run_job(job, Selection(from_stage, only, resume), display or SilentDisplay())
    return Run(job.folder)


def prepare(
    recording: Path | str, folder: Path | str, *, probe: Path | str | None, configuration: Configuration
) -> Job:
    """Open the inputs of a run without starting it; raises as `run`."""
    file = None if probe is None else Path(probe)
    return open_job(Path(recording), Path(folder), file, PIPELINE, EXPORTERS, configuration)


def configuration(config: Path | str | None = None, settings: Sequence[str] = ()) -> Configuration:
    """Return the parameters of every stage: the defaults, those of ``config``, then ``settings``.

    Raises
    ------
    InputError
        For a file that cannot be read, an unknown name, or a value of the wrong type or out of range.
    """
    file = None if config is None else file_or_shipped(Path(config), PARAMETERS)
    return resolve(PIPELINE, file, settings)
