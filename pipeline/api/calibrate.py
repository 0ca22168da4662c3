"""Calibrates a probe from a script, in the same way as `boresight calibrate`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.api.job import open_job, result_of, run_job
from pipeline.files.disk import require_writable
from pipeline.files.installed import PARAMETERS, file_or_shipped
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe_file import write_probe
from pipeline.machine.configuration import resolve
from pipeline.machine.display import Display, SilentDisplay
from pipeline.machine.outcome import warnings_of
from pipeline.machine.plan import Selection
from pipeline.machine.run_folder import Exporter
from stages.calibrate.gauge import GAUGE, GaugeCalibration, require_gauge
from stages.premises import PREMISES
from stages.rings import RINGS

STAGES = (PREMISES, RINGS, GAUGE)


@dataclass(frozen=True)
class Calibration:
    """A calibrated probe.

    Attributes
    ----------
    path : Path
        Folder with probe.yaml, calibration.json and calibration.html.
    result : GaugeCalibration
        The probe before (``stated``) and after (``probe``, with its covariance), and the measurements.
    warnings : tuple of str
        Warnings of the reader of the recording and of the stages.
    """

    path: Path
    result: GaugeCalibration
    warnings: tuple[str, ...]

    @property
    def probe_file(self) -> Path:
        """The calibrated probe, which `run` and `diagnose` take as their ``probe``."""
        return self.path / "probe.yaml"


def calibrate(
    gauge: Path | str,
    output: Path | str,
    *,
    probe: Path | str | None = None,
    config: Path | str | None = None,
    settings: Sequence[str] = (),
    display: Display | None = None,
) -> Calibration:
    """Find camera and laser sheet, with covariance, from a run through a gauge of known bore.

    Results that the folder already holds for the same inputs, parameters and program are used again.

    Parameters
    ----------
    gauge : path
        The recording of the gauge run: a folder, or a bag.
    output : path
        Folder for probe.yaml, calibration.json and calibration.html.
    probe : path, optional
        File of the stated probe; by default the one that the recording names.
    config : path or str, optional
        A file of parameters of the stages `premises`, `rings` and `gauge`.
    settings : sequence of str
        Single parameters, each ``stage.name=value``; they override those of ``config``.
    display : Display, optional
        Receives the progress of the stages; by default nothing is shown.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        When the recording, the probe, a parameter or the folder cannot be used, or it is not a gauge run.
    UnusableError
        When the recording is well formed, but a stage cannot measure what it needs.
    Cancelled
        When the user stopped it with Ctrl-C; the same call continues from there.
    """
    file = None if config is None else file_or_shipped(Path(config), PARAMETERS)
    configuration = resolve(STAGES, file, settings)
    folder, stated = Path(output), None if probe is None else Path(probe)
    job = open_job(Path(gauge), folder, stated, STAGES, EXPORTERS, configuration, "calibrate")
    require_gauge(job.recording)
    require_writable(folder)
    outcome = run_job(job, Selection(), display or SilentDisplay())
    warnings = (*job.recording.warnings, *warnings_of(outcome.stages))
    return Calibration(folder, result_of(job, GaugeCalibration), warnings)


def write_calibration(result: GaugeCalibration, made_by: MadeBy, folder: Path) -> None:
    """Write probe.yaml, calibration.json and calibration.html."""
    # matplotlib takes a second to load, for which a refusal need not wait
    from pipeline.api.calibration_report import write_report

    write_probe(result.probe, folder / "probe.yaml", made_by)
    write_report(result, made_by, folder)


EXPORTERS = (Exporter("calibration", write_calibration),)
