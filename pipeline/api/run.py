"""Processes a recording from a script, in the same way as `boresight run`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipeline.api.dirt import dirt_of
from pipeline.api.job import Job, open_job, run_job
from pipeline.artefacts.findings import Defects, Sections
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory, Wall, WallTexture
from pipeline.errors import BoresightError, InputError
from pipeline.export.catalogue import EXPORTERS
from pipeline.files.installed import PARAMETERS, file_or_shipped
from pipeline.instrument.probe import Probe
from pipeline.machine.configuration import Configuration, resolve
from pipeline.machine.display import Display, SilentDisplay
from pipeline.machine.outcome import Number
from pipeline.machine.plan import Selection
from pipeline.recording.base import Recording
from pipeline.review.decisions.replay import Finding
from pipeline.review.review import Review
from pipeline.review.run_files import RunFiles, measured_findings
from stages.catalogue import PIPELINE


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

    Results that the folder already holds for the same inputs, parameters and program are used again.

    Parameters
    ----------
    recording : path
        A recording's folder, or a bag.
    folder : path
        The run folder: a new one, an empty one, or that of an earlier run.
    probe : path, optional
        The probe file to use; by default the one that the recording names.
    config : path or str, optional
        A file of parameters, or the name of a shipped one (`shipped_names`).
    settings : sequence of str
        Single parameters, each ``stage.name=value``; they override those of ``config``.
    twin : path, optional
        Folder of `twin` on an earlier run of this recording: dirt and drops that it found are excluded from
        photo and rings, and so from findings.
    from_stage : str
        Compute this stage and all after it again.
    only : str
        Run this stage alone.
    resume : bool
        Whether to use existing results; False computes everything again.
    display : Display, optional
        Receives the progress of the stages; by default nothing is shown.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        When the recording, the probe, a parameter or the folder cannot be used.
    UnusableError
        When the recording is well formed, but a stage cannot measure what it needs.
    Cancelled
        When the user stopped it with Ctrl-C; the same call continues from there.
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


def configuration(config: Path | str | None = None, settings: Sequence[str] = ()) -> Configuration:
    """Return the parameters of every stage: the defaults, those of ``config``, then ``settings``.

    Raises
    ------
    InputError
        For a file that cannot be read, an unknown name, or a value of the wrong type or out of range.
    """
    file = None if config is None else file_or_shipped(Path(config), PARAMETERS)
    return resolve(PIPELINE, file, settings)


if TYPE_CHECKING:
    import pandas

TableName = Literal["sections", "defects", "trajectory"]


class MissingPackageError(BoresightError):
    """An optional package is needed for this call; the text says how to install it."""


@dataclass(frozen=True)
class Run:
    """A run folder. Everything is read at first use; big arrays are mapped from their files.

    Lengths are in mm, angles in rad unless a name says deg, times in s. Frame C is the camera (x right, y
    down, z forward), P the pipe (z along it); ``T_pc`` maps C to P. A σ is one standard deviation. NaN means
    not measured. The arrays are read-only.

    Attributes
    ----------
    path : Path
        The run folder.
    """

    path: Path

    @property
    def numbers(self) -> tuple[Number, ...]:
        """Headline numbers with their units: distance, wall seen, mean diameter, defects, and so on."""
        return tuple(Number(n["name"], n["value"], n["unit"]) for n in self._files.record()["metrics"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the reader of the recording and of the stages."""
        record = self._files.record()
        return (*record["reader_warnings"], *record["warnings"])

    @property
    def rings(self) -> RingSamples:
        """The laser line in every laser frame: (F, A) radii in px with their σ, by image azimuth."""
        return self._files.artefact(RingSamples)

    @property
    def ring_points(self) -> RingPoints:
        """The ring samples triangulated: (F, A, 3) points in C, mm, with their uncertainty."""
        return self._files.artefact(RingPoints)

    @property
    def trajectory(self) -> Trajectory:
        """The camera at every frame: (N, 4, 4) ``T_pc`` with (N, 6, 6) covariance, and the pipe's axis."""
        return self._files.artefact(Trajectory)

    @property
    def wall(self) -> Wall:
        """The wall: (S, A) radius, mm, over distance and azimuth with its σ; point cloud and axis."""
        return self._files.artefact(Wall)

    @property
    def texture(self) -> WallTexture:
        """The wall's photo, unrolled: (H, W, 4) B, G, R, alpha, with its scale in mm and rad a pixel."""
        return self._files.artefact(WallTexture)

    @property
    def sections(self) -> Sections:
        """Diameters (mm) and ovalities of K cross-sections along the pipe, each (K,) with its σ."""
        return self._files.artefact(Sections)

    @property
    def defects(self) -> Defects:
        """The defects as measured; `findings` has them with the inspector's decisions."""
        return self._files.artefact(Defects)

    def findings(self) -> tuple[Finding, ...]:
        """Return the findings with the decisions of the review: accepted, edited, merged, split and added.

        Raises
        ------
        InputError
            When the run or its decisions cannot be read.
        """
        review = Review(self._files)
        if not review.ledger.file.exists():  # nobody has opened the review yet
            return measured_findings(self._files.defects_text(), self._files.file("defects.json"))
        return review.state().findings

    def probe(self) -> Probe:
        """Return the probe with its parameters as this run estimated them.

        Raises
        ------
        InputError
            When the probe's file is gone or has changed since the run.
        """
        return self._files.probe()

    def recording(self) -> Recording:
        """Return the opened recording of the run.

        Raises
        ------
        InputError
            When the recording is gone or has changed since the run.
        """
        return self._files.recording()

    def table(self, name: TableName) -> pandas.DataFrame:
        """Return a table of the run folder, with the columns of its CSV file; units are in their names.

        Parameters
        ----------
        name : {'sections', 'defects', 'trajectory'}

        Raises
        ------
        MissingPackageError
            When pandas is not installed.
        InputError
            When the run has no such table.
        """
        try:
            import pandas  # a run folder is read without it
        except ImportError as error:
            raise MissingPackageError(
                "A table needs the package pandas, which is not installed.\n"
                "What to do: pip install 'boresight[tables]'"
            ) from error
        file = self._files.file(f"{name}.csv")
        if not file.is_file():
            raise InputError(file, "does not exist", hint="state one of: sections, defects, trajectory")
        return pandas.read_csv(file)

    @property
    def _files(self) -> RunFiles:
        return RunFiles(self.path)


def open_run(folder: Path | str) -> Run:
    """Open the folder of a completed run.

    Raises
    ------
    InputError
        When the folder holds no completed run.
    """
    opened = Run(Path(folder))
    RunFiles(opened.path).record()
    return opened
