"""Simulates the effects that a diagnosis found, and compares them with pictures of its gauge run.

A name is kept only if the line, rendered again with it, fits the pictures of the gauge run better.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.api.diagnosis.inputs import open_inputs
from pipeline.api.job import Job, result_of, run_job
from pipeline.artefacts.twin import GaugeTwin, Mismatch, NamedFigure
from pipeline.drill.answer import NamedEffect, Value, read_answer
from pipeline.drill.cases import ANSWER
from pipeline.errors import InputError
from pipeline.files.json_yaml import read_json
from pipeline.machine.configuration import resolve
from pipeline.machine.display import Display
from pipeline.machine.plan import Selection
from pipeline.physics.catalogue import ALL_EFFECTS, effect
from pipeline.physics.effect import CONSTANTLY, COURSES, Channel, Course, CourseKind
from pipeline.simulator.effects.switch import Switch
from stages.diagnose.channels import FIDUCIALS
from stages.premises import PREMISES
from stages.rings import RINGS
from stages.twin.gauge_line import GAUGE_LINE

_SURE = 0.5
"""Probability from which an effect counts as found: more likely than not."""
_OF_LINE = ("laser", "camera", "window")


@dataclass(frozen=True)
class Switches:
    """The effects of a diagnosis.

    Attributes
    ----------
    found : tuple of Switch
        Switches of the effects that the simulator can render.
    effects : tuple of NamedEffect
        The same effects as in diagnosis.json.
    inexpressible : tuple of str
        Sentences about the others.
    by_chance : float
        Probability of such a result by chance when nothing was left out; NaN if it is not stated.
    """

    found: tuple[Switch, ...]
    effects: tuple[NamedEffect, ...]
    inexpressible: tuple[str, ...]
    by_chance: float = math.nan

    @property
    def of_line(self) -> tuple[Switch, ...]:
        """Return those that displace the laser line in a picture."""
        return tuple(s for s in self.found if moves_line(s.name))


def moves_line(name: str) -> bool:
    """Return whether an effect displaces the line of a known bore in the picture."""
    known = ALL_EFFECTS.get(name)
    return known is not None and known.family in _OF_LINE and known.channel is Channel.RING


def switches_of(file: Path) -> Switches:
    """Return the effects of a diagnosis.json with their sizes; sizes that it lacks are the typical ones.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    found, effects, inexpressible = [], [], []
    answer = read_answer(file)
    for said in answer.effects:
        switch = _switch(said) if said.probability >= _SURE or math.isnan(said.probability) else None
        if switch is None:
            inexpressible.append(
                f"{said.name.replace('_', ' ').capitalize()} is not simulated: {_why(said)}."
            )
        else:
            found.append(switch)
            effects.append(said)
    by_chance = math.nan if answer.global_p is None else answer.global_p
    return Switches(tuple(found), tuple(effects), tuple(inexpressible), by_chance)


def _why(said: NamedEffect) -> str:
    if said.probability < _SURE:
        return f"its probability is {said.probability:.2g}"
    return "the simulator has no law for it, or none for such a size"


def _switch(said: NamedEffect) -> Switch | None:
    if said.name not in ALL_EFFECTS:
        return None
    sizes = tuple(_size(said.parameters, q.name, q.typical) for q in ALL_EFFECTS[said.name].quantities)
    try:
        return Switch(said.name, sizes, _course(said))
    except (InputError, ValueError):
        return None


def _course(said: NamedEffect) -> Course:
    if said.course is None or said.course.get("kind") in (None, "constant"):
        return CONSTANTLY
    kind = CourseKind(str(said.course["kind"]))
    if {q.name for q in COURSES[kind]} & {q.name for q in ALL_EFFECTS[said.name].quantities}:
        return CONSTANTLY  # its own law contains the course in time, as that of a drifting baseline
    numbers = {k: Value.model_validate(v) for k, v in said.course.items() if isinstance(v, dict)}
    return Course(kind, tuple(_size(numbers, q.name, q.typical) for q in COURSES[kind]))


def _size(numbers: dict[str, Value], name: str, usual: float) -> float:
    value = numbers[name].value if name in numbers else math.nan
    return value if math.isfinite(value) else usual


_STAGES = (*(s.for_role("gauge") for s in (PREMISES, RINGS, FIDUCIALS)), GAUGE_LINE)


@dataclass(frozen=True)
class DiagnosisTried:
    """Comparison of a diagnosis with pictures of its gauge run; empty without one.

    Attributes
    ----------
    gauge : GaugeTwin or None
        None without a gauge run, or if no named effect moves the line.
    found, withdrawn : tuple of Mismatch
        Effects with which the pictures fit better, and those with which they do not.
    cannot_tell : tuple of str
    """

    gauge: GaugeTwin | None = None
    found: tuple[Mismatch, ...] = ()
    withdrawn: tuple[Mismatch, ...] = ()
    cannot_tell: tuple[str, ...] = ()


def try_diagnosis(diagnosis: Path, folder: Path, display: Display) -> DiagnosisTried:
    """Re-render the line of a diagnosis' gauge run with the stated probe and with the effects found.

    Parameters
    ----------
    diagnosis : Path
        Folder of `boresight diagnose`; its measurements of the gauge run are used again.
    folder : Path
        Folder for the results of the stages.

    Raises
    ------
    InputError
        When the folder is not that of a diagnosis, or its gauge run or probe cannot be used.
    """
    said, gauge, probe = switches_of(diagnosis / ANSWER), *_inputs(diagnosis / "run.json")
    still = tuple(
        f"The gauge's pictures cannot show {s.name.replace('_', ' ')}: it does not move the line in them."
        for s in said.found
        if not moves_line(s.name)
    )
    if gauge is None:
        sentence = (
            "The diagnosis had no gauge run. An inspection measures wall and poses with the instrument that "
            "is in doubt, so that its error looks like the wall's own shape. What to do: record a gauge run."
        )
        return DiagnosisTried(cannot_tell=(*said.inexpressible, *still, sentence))
    if not said.of_line:
        return DiagnosisTried(cannot_tell=(*said.inexpressible, *still))
    inputs = open_inputs(None, gauge, probe)
    effects = json.dumps([s.text for s in said.of_line])
    configuration = resolve(_STAGES, None, [f"gauge_line.effects={effects}"])
    job = Job("twin", inputs.sources(), _STAGES, (), configuration, folder, inputs.record(), (diagnosis,))
    run_job(job, Selection(), display)
    return _judged(said, result_of(job, GaugeTwin), still)


def _judged(said: Switches, found: GaugeTwin, still: tuple[str, ...]) -> DiagnosisTried:
    named = [e for s, e in zip(said.found, said.effects, strict=True) if moves_line(s.name)]
    each = [_mismatch(e, kept, found, said.by_chance) for e, kept in zip(named, found.kept, strict=True)]
    power = (
        f"A line displaced by less than about {found.least_px:.2f} px raises χ² in the gauge's pictures by "
        "less than a tenth: instruments that differ by less cannot be distinguished."
    )
    kept, withdrawn = (
        tuple(m for m, k in zip(each, found.kept, strict=True) if k == want) for want in (True, False)
    )
    return DiagnosisTried(found, kept, withdrawn, (*said.inexpressible, *still, power))


def _mismatch(named: NamedEffect, kept: bool, found: GaugeTwin, by_chance: float) -> Mismatch:
    """Return an effect as a mismatch of the line in the gauge run's pictures."""
    words = named.name.replace("_", " ")
    verdict = "fit better with it" if kept else "do not fit better with it, so that the name is withdrawn"
    sizes = {q.name: q.unit for q in effect(named.name).quantities}
    figures = tuple(
        NamedFigure(name, value.value, value.sd, sizes.get(name, ""))
        for name, value in named.parameters.items()
    )
    return Mismatch(
        named.name, "line", str(effect(named.name).fixed_to), (), figures, by_chance,
        found.chi2_stated, found.chi2_diagnosed,
        f"{words.capitalize()}, named by the diagnosis: pictures of the gauge run {verdict}.",
    )  # fmt: skip


def _inputs(record: Path) -> tuple[Path | None, Path]:
    """Return gauge run and stated probe of a diagnosis' record."""
    try:
        tree: dict[str, Any] = read_json(record)
        gauge = tree.get("gauge")
        return None if gauge is None else Path(gauge["path"]), Path(tree["probe"]["path"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            record, "is not the record of a diagnosis", expected="run.json of boresight diagnose"
        ) from error
