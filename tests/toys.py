"""A pipeline of three quick stages over a recording without pictures, for the machine's own tests."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pipeline.config import resolve
from pipeline.display import SilentDisplay
from pipeline.errors import UnusableError
from pipeline.export.exporter import Exporter
from pipeline.instrument.camera.kannala_brandt import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.job import Job, run_job
from pipeline.outcome import Results, RunOutcome
from pipeline.recording.base import FrameTable, Image, Int, PipeFacts, Planes, Recording
from pipeline.runner import Selection
from pipeline.stage import Context, Parameters, Stage

Float = NDArray[np.float64]


class Mood(StrEnum):
    CALM = "calm"
    WILD = "wild"


@dataclass(frozen=True)
class Drawn:
    values: Float
    mood: Mood


@dataclass(frozen=True)
class Smoothed:
    values: Float
    width: int


@dataclass(frozen=True)
class Total:
    total: float
    parts: tuple[Smoothed, ...]


class DrawParameters(Parameters):
    count: int = Field(1000, ge=1, le=5_000_000, description="numbers drawn")
    mood: Mood = Field(Mood.CALM, description="mood of the numbers")
    pause_s: float = Field(0.0, ge=0, le=1, description="pause at each step, s")


class SmoothParameters(Parameters):
    width: int = Field(3, ge=1, le=99, description="width of the mean, samples")
    fails: bool = Field(False, description="whether to break")
    unusable_above: float = Field(1e9, gt=0, description="largest value that can be used")


class TotalParameters(Parameters):
    weights: tuple[float, ...] = Field((1.0, 1.0), description="weights of the parts")


def draw(recording: Recording, *, parameters: DrawParameters, context: Context) -> Drawn:
    for step in range(4):
        time.sleep(parameters.pause_s)
        context.progress(step + 1, 4)
    context.report("rejected: dull", 7, "numbers")
    return Drawn(context.random.normal(size=parameters.count), parameters.mood)


def smooth(drawn: Drawn, *, parameters: SmoothParameters, context: Context) -> Smoothed:
    if parameters.fails:
        raise ZeroDivisionError("the toy broke")
    if drawn.values.max() > parameters.unusable_above:
        raise UnusableError("smooth", "too large", limit=f"{parameters.unusable_above}", frames=(3,))
    kernel = np.ones(parameters.width) / parameters.width
    return Smoothed(np.convolve(drawn.values, kernel, "same"), parameters.width)


def add_up(drawn: Drawn, smoothed: Smoothed, *, parameters: TotalParameters, context: Context) -> Total:
    total = parameters.weights[0] * drawn.values.sum() + parameters.weights[1] * smoothed.values.sum()
    return Total(float(total), (smoothed, replace(smoothed, width=1)))


DRAW = Stage("draw", "1", DrawParameters, draw, "numbers from nowhere")
SMOOTH = Stage("smooth", "1", SmoothParameters, smooth, "numbers to smooth numbers")
TOTAL = Stage("total", "1", TotalParameters, add_up, "everything to one number")
TOYS = (DRAW, SMOOTH, TOTAL)


def write_numbers(smoothed: Smoothed, folder: Path) -> None:
    (folder / "numbers.dir").mkdir()
    np.save(folder / "numbers.dir" / "values.npy", smoothed.values)


def write_page(results: Results, folder: Path) -> None:
    total = results.of(Total)
    assert total is not None
    (folder / "report.html").write_text(f"{total.total!r}")


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


def toy_job(folder: Path, *assignments: str) -> Job:
    configuration = resolve(TOYS, None, assignments)
    return Job(toy_recording(), toy_probe(), Path("probe.yaml"), TOYS, TOY_EXPORTERS, configuration, folder)


def run_toys(folder: Path, *assignments: str, selection: Selection | None = None) -> RunOutcome:
    return run_job(toy_job(folder, *assignments), selection or Selection(), SilentDisplay())


if __name__ == "__main__":
    run_toys(Path(sys.argv[1]), *sys.argv[2:])
