"""A run of the toy stages over a recording without pictures."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.api.job import Job, recording_job, run_job
from pipeline.arrays import Image, Int
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import ProbeSource
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.outcome import RunOutcome
from pipeline.machine.plan import Selection
from pipeline.machine.run_folder import Exporter
from pipeline.recording.base import FrameTable, PipeFacts, Planes, Recording
from tests.toy_stages import TOYS, write_numbers, write_page

TOY_EXPORTERS = (Exporter("numbers", write_numbers), Exporter("page", write_page))


@dataclass(frozen=True)
class NoFrames:
    image_size: tuple[int, int] = (64, 48)

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        yield from ()


def toy_recording() -> Recording:
    frames = FrameTable(np.arange(3), np.arange(3) / 10, np.array(["laser", "led", "laser"]))
    pipe = PipeFacts(nominal_diameter_mm=100.0)
    return Recording(
        "toy", "inspection", Path("toy"), frames, None, pipe, 10.0, NoFrames(), None, "0" * 64, ("mended",)
    )


def toy_probe() -> Probe:
    camera = KannalaBrandt((64, 48), (20.0, 20.0), (31.5, 23.5))
    laser = LaserSheet(22.0)
    count = len(camera.parameter_names) + len(LaserSheet.PARAMETER_NAMES)
    return Probe(camera, laser, np.zeros((count, count)))


def toy_job(folder: Path, *assignments: str, probe: ProbeSource | None = None) -> Job:
    configuration = resolve(TOYS, None, assignments)
    return recording_job(
        toy_recording(),
        toy_probe(),
        probe or ProbeSource(Path("probe.yaml"), "", None),
        TOYS,
        TOY_EXPORTERS,
        configuration,
        folder,
    )


def run_toys(folder: Path, *assignments: str, selection: Selection | None = None) -> RunOutcome:
    return run_job(toy_job(folder, *assignments), selection or Selection(), SilentDisplay())


if __name__ == "__main__":
    run_toys(Path(sys.argv[1]), *sys.argv[2:])
