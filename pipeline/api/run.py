"""A recording run from a script, as `boresight run` runs it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from pipeline.api.job import Job, open_job, run_job
from pipeline.api.opened import Run
from pipeline.errors import InputError
from pipeline.export.catalogue import EXPORTERS
from pipeline.files.json_file import read_json
from pipeline.files.shipped import PARAMETERS, file_or_shipped
from pipeline.machine.configuration import Configuration, resolve
from pipeline.machine.display import Display, SilentDisplay
from pipeline.machine.plan import Selection
from stages.catalogue import PIPELINE

_PLACE = ("u_px", "v_px", "radius_px")
_WIDER = 1.5
"""A spot's edge reaches beyond the place where it was found. Derived for Gaussian spots that take 10 to 50 %:
their change falls to 3 %, where they are found, at 1.5 to 2.4 of their σ, and to 1 % at 2.1 to 2.8."""


def run(
    recording: Path | str,
    folder: Path | str,
    *,
    probe: Path | str | None = None,
    config: Path | str | None = None,
    settings: Sequence[str] = (),
    twin: Path | str | None = None,
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
    twin : path, optional
        Folder of `twin` on an earlier run of this recording: dirt that it found is kept out of the photo.
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
    parameters = configuration(config, [*dirt_of(twin), *settings])
    job = prepare(recording, folder, probe=probe, configuration=parameters)
    run_job(job, Selection(from_stage, only, resume), display or SilentDisplay())
    return Run(job.folder)


def prepare(
    recording: Path | str, folder: Path | str, *, probe: Path | str | None, configuration: Configuration
) -> Job:
    """Open the inputs of a run without starting it; raises as `run`."""
    file = None if probe is None else Path(probe)
    return open_job(Path(recording), Path(folder), file, PIPELINE, EXPORTERS, configuration)


def dirt_of(twin: Path | str | None) -> tuple[str, ...]:
    """Return the setting that keeps the dirt out of the photo that a twin found on window or lens.

    Raises
    ------
    InputError
        When the folder holds no twin.json, or a broken one.
    """
    if twin is None:
        return ()
    file = Path(twin) / "twin.json"
    try:
        on_image = [m for m in read_json(file)["found"] if m["fixed_to"] == "image"]
        places = [[float(m["place"][k]["value"]) for k in _PLACE] for m in on_image]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            file, "is not what a twin found", expected="twin.json of boresight twin", hint="name its folder"
        ) from error
    return (f"texture.left_out={json.dumps([[u, v, _WIDER * r] for u, v, r in places])}",)


def configuration(config: Path | str | None = None, settings: Sequence[str] = ()) -> Configuration:
    """Return the parameters of every stage: the defaults, those of ``config``, then ``settings``.

    Raises
    ------
    InputError
        For a file that cannot be read, an unknown name, or a value of the wrong type or out of range.
    """
    file = None if config is None else file_or_shipped(Path(config), PARAMETERS)
    return resolve(PIPELINE, file, settings)
