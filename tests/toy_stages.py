"""Three quick stages and two exporters, for tests of the runner."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from pydantic import Field

from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.machine.outcome import Results
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Recording


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


@dataclass(frozen=True)
class Weighed:
    value: float


def weigh(drawn: Drawn, total: Total | None, *, parameters: Parameters, context: Context) -> Weighed:
    return Weighed(float(drawn.values.sum()) if total is None else total.total)


def add_up(drawn: Drawn, smoothed: Smoothed, *, parameters: TotalParameters, context: Context) -> Total:
    total = parameters.weights[0] * drawn.values.sum() + parameters.weights[1] * smoothed.values.sum()
    return Total(float(total), (smoothed, replace(smoothed, width=1)))


DRAW = Stage("draw", "1", DrawParameters, draw, "numbers from nowhere")
SMOOTH = Stage("smooth", "1", SmoothParameters, smooth, "numbers to smooth numbers")
TOTAL = Stage("total", "1", TotalParameters, add_up, "everything to one number")
WEIGH = Stage("weigh", "1", Parameters, weigh)
TOYS = (DRAW, SMOOTH, TOTAL)


def write_numbers(smoothed: Smoothed, folder: Path) -> None:
    (folder / "numbers.dir").mkdir()
    np.save(folder / "numbers.dir" / "values.npy", smoothed.values)


def write_page(results: Results, folder: Path) -> None:
    total = results.of(Total)
    assert total is not None
    (folder / "report.html").write_text(f"{total.total!r}")
