"""Compares a run's frames with re-rendered ones from a script, in the same way as `boresight twin`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from pipeline.api.diagnosis.simulated import DiagnosisTried, try_diagnosis
from pipeline.api.job import Job, open_job, result_of, run_job, value_source
from pipeline.artefacts.twin import GaugeTwin, Mismatch, NamedFigure, Twin, TwinView
from pipeline.errors import InputError
from pipeline.export.report.pictures import jpeg_uri
from pipeline.export.run_record import check_inputs_unchanged, read_run_record
from pipeline.files.json_yaml import json_number
from pipeline.files.provenance import MadeBy
from pipeline.machine.configuration import resolve
from pipeline.machine.display import Display, SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.machine.run_folder import Exporter, RunFolder
from pipeline.pages import page_template
from stages.catalogue import PIPELINE
from stages.texture import TEXTURE
from stages.twin import PHOTOMETRY, TWIN

# With this compression, forty frames make one page of a few MB; the figures come from uncompressed frames.
_JPEG_QUALITY = 85
_MEASURED = PIPELINE[: PIPELINE.index(TEXTURE) + 1]


def twin(
    run: Path | str,
    output: Path | str,
    *,
    diagnosis: Path | str | None = None,
    settings: Sequence[str] = (),
    display: Display | None = None,
) -> Twin:
    """Re-render frames of a run, compare them with the recorded ones, and say where and why they differ.

    The run's results are used, unless the program has changed or ``diagnosis`` has another probe.

    Parameters
    ----------
    run : path
        A run folder, preferably of a run with ``premises.withhold=10``, whose withheld frames no stage has
        used.
    output : path
        Folder for twin.json and twin.html.
    diagnosis : path, optional
        Folder of a diagnosis, whose corrected probe replaces the run's: wall, motion and photo are computed
        again with it.
    settings : sequence of str
        Single parameters, each ``stage.name=value``; they override those of the run.
    display : Display, optional
        Receives the progress of the stages; by default nothing is shown.

    Raises
    ------
    InputError
        When run, recording, diagnosis or folder cannot be used.
    UnusableError
        When no frame can be re-rendered.
    Cancelled
        When the user stopped it with Ctrl-C; the same call continues from there.
    """
    shown = display or SilentDisplay()
    job = twin_job(Path(run), Path(output), None if diagnosis is None else Path(diagnosis), settings, shown)
    run_job(job, Selection(), shown)
    return result_of(job, Twin)


@dataclass(frozen=True)
class TwinOf:
    """The folder of the run whose frames are re-rendered, and the differences from that run.

    Attributes
    ----------
    run : str
    again : tuple of str
        Stages that are computed again because the program or their parameters have changed.
    diagnosed : bool
        Whether the corrected probe of a diagnosis replaces the run's, so that all is computed again.
    """

    run: str
    again: tuple[str, ...] = ()
    diagnosed: bool = False


def twin_job(
    run: Path, output: Path, diagnosis: Path | None, settings: Sequence[str], display: Display
) -> Job:
    """Open the inputs of a twin without starting it; raises as `twin`.

    A diagnosis is first compared with the pictures of its gauge run, which takes half a minute.
    """
    record = read_run_record(run)
    probe, tried = record.probe, DiagnosisTried()
    if diagnosis is not None:
        probe = diagnosis / "probe.yaml"
        if not probe.is_file():
            raise InputError(diagnosis, "holds no probe.yaml", expected="the folder of boresight diagnose")
        tried = try_diagnosis(diagnosis, output, display)
    earlier = {s.name: record.configuration[s.name] for s in _MEASURED if s.name in record.configuration}
    stages = (*_MEASURED, PHOTOMETRY, TWIN)
    configuration = resolve(stages, None, settings, earlier, run / "run.json")
    job = open_job(record.recording, output, probe, stages, EXPORTERS, configuration, "twin")
    again: tuple[str, ...] = ()
    if diagnosis is None:
        check_inputs_unchanged(record, {s.kind.__name__.lower(): s.key for s in job.sources})
        kept = RunFolder(run).store
        steps = [job.plan.step(s.label) for s in _MEASURED]
        again = tuple(s.stage.label for s in steps if not kept.has(s.stage.name, s.key))
    more = value_source(tried), value_source(TwinOf(str(run.resolve()), again, diagnosis is not None))
    return replace(job, sources=(*job.sources, *more), lent=(run,))


def twin_document(found: Twin, tried: DiagnosisTried, of: TwinOf) -> dict[str, Any]:
    """Return a twin as plain data; unknown values are None."""
    gauge = None if tried.gauge is None else _gauge(tried.gauge)
    return {
        "format": 1,
        "run": of.run,
        "computed_again": list(of.again),
        "with_diagnosis": of.diagnosed,
        "frames": [int(f) for f in found.frame],
        "withheld": found.withheld,
        "noise": _figures(found.noise),
        "state": _figures(found.state),
        "regions": {
            r.name: {
                "pixels": r.pixels,
                "chi2_before": json_number(r.chi2_before),
                "chi2_after": json_number(r.chi2_after),
            }
            for r in found.regions
        },
        "found": [_mismatch(m) for m in (*tried.found, *found.found)],
        "worst": [_mismatch(m) for m in found.worst],
        "withdrawn": [_mismatch(m) for m in (*tried.withdrawn, *found.withdrawn)],
        "gauge": gauge,
        "psnr_db": json_number(found.psnr_db),
        "psnr_noise_free_db": json_number(found.psnr_noise_free_db),
        "chi2_wall_camera_noise_alone": json_number(found.chi2_camera),
        "stray_light_in_dark": found.stray,
        "seen": found.seen,
        "compared_of_seen": found.compared,
        "chi2_by_brightness": _figures(found.by_level),
        "cannot_tell": [*tried.cannot_tell, *found.cannot_tell],
    }


def _gauge(gauge: GaugeTwin) -> dict[str, Any]:
    plain = {k: json_number(v) if isinstance(v, float) else v for k, v in vars(gauge).items() if k != "frame"}
    return {"frames": [int(f) for f in gauge.frame], **plain}


def _mismatch(mismatch: Mismatch) -> dict[str, Any]:
    plain = asdict(mismatch)
    figures = {"place": _figures(mismatch.place), "parameters": _figures(mismatch.parameters)}
    chi2 = {name: json_number(plain[name]) for name in ("chi2_before", "chi2_after", "probability")}
    return plain | figures | chi2 | {"name": mismatch.name or None}


def _figures(figures: Sequence[NamedFigure]) -> dict[str, Any]:
    return {f.name: {"value": json_number(f.value), "sd": json_number(f.sd), "unit": f.unit} for f in figures}


def psnr_without_noise(found: Twin) -> str:
    """Return in words the peak signal-to-noise ratio of lit wall after subtraction of the noise."""
    if math.isnan(found.psnr_db):
        return "not compared"
    if math.isinf(found.psnr_noise_free_db):
        return "no difference beyond the noise"
    return f"{found.psnr_noise_free_db:.1f} dB"


def write_twin(found: Twin, tried: DiagnosisTried, of: TwinOf, made_by: MadeBy, folder: Path) -> None:
    """Write twin.json and twin.html."""
    document = twin_document(found, tried, of) | {"made_by": made_by.document()}
    (folder / "twin.json").write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", "utf-8")
    views = [_shown(v) for v in found.views]
    maps = [{"name": m.name, "picture": jpeg_uri(m.picture, _JPEG_QUALITY)} for m in found.maps]
    psnr = psnr_without_noise(found)
    page = page_template("twin").render(d=document, views=views, maps=maps, psnr=psnr)
    (folder / "twin.html").write_text(page, "utf-8")


def _shown(view: TwinView) -> dict[str, Any]:
    return {
        "frame": view.frame,
        "light": view.light,
        "chi2": round(view.chi2, 2),
        "recorded": jpeg_uri(view.recorded, _JPEG_QUALITY),
        "twin": jpeg_uri(view.twin, _JPEG_QUALITY),
        "z": jpeg_uri(view.z, _JPEG_QUALITY),
    }


EXPORTERS = (Exporter("twin", write_twin),)
