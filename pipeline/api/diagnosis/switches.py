"""What a diagnosis found, as the simulator switches it on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.physics.catalogue import ALL_EFFECTS
from pipeline.physics.effect import CONSTANTLY, COURSES, Course, CourseKind
from pipeline.simulator.effects.switch import Switch
from stages.diagnose.drill.answer import NamedEffect, Value, read_answer

_SURE = 0.5
"""Probability from which an effect counts as found: it is likelier there than not."""
_OF_LINE = ("laser", "camera", "window")


@dataclass(frozen=True)
class Switches:
    """The effects of a diagnosis.

    Attributes
    ----------
    found : tuple of Switch
        Those that the simulator can switch on.
    effects : tuple of NamedEffect
        The same as diagnosis.json has them.
    unsaid : tuple of str
        Sentences about the others.
    """

    found: tuple[Switch, ...]
    effects: tuple[NamedEffect, ...]
    unsaid: tuple[str, ...]

    @property
    def of_line(self) -> tuple[Switch, ...]:
        """Those that change where the laser line lies in a picture."""
        return tuple(s for s in self.found if moves_line(s.name))


def moves_line(name: str) -> bool:
    """Return whether an effect changes where the line of a known bore lies in the picture."""
    return name in ALL_EFFECTS and ALL_EFFECTS[name].family in _OF_LINE


def switches_of(file: Path) -> Switches:
    """Return what a diagnosis.json says, with the sizes found; those it does not tell are the usual ones.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    found, effects, unsaid = [], [], []
    for said in read_answer(file).effects:
        switch = _switch(said) if said.probability >= _SURE or math.isnan(said.probability) else None
        if switch is None:
            unsaid.append(f"The simulator is not told of {said.name.replace('_', ' ')}: {_why(said)}.")
        else:
            found.append(switch)
            effects.append(said)
    return Switches(tuple(found), tuple(effects), tuple(unsaid))


def _why(said: NamedEffect) -> str:
    if said.probability < _SURE:
        return f"its probability is {said.probability:.2g}"
    return "it has no law for it, or not for such a size"


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
    numbers = {k: Value.model_validate(v) for k, v in said.course.items() if isinstance(v, dict)}
    return Course(kind, tuple(_size(numbers, q.name, q.typical) for q in COURSES[kind]))


def _size(numbers: dict[str, Value], name: str, usual: float) -> float:
    value = numbers[name].value if name in numbers else math.nan
    return value if math.isfinite(value) else usual
