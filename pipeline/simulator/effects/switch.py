"""An effect with its sizes, and how it is written on the command line, in YAML and in the truth.

The text is ``NAME`` alone for the typical size, or ``NAME=VALUE`` followed by any of

==========  ===========================================  ============================
``@40``     a direction or azimuth, deg                  ``laser_tilt=0.6@40``
``x3``      an order                                     ``sheet_waviness=0.3x3@30``
``/40s``    any other quantity, recognised by its unit   ``baseline_drift=0.05/40s``
==========  ===========================================  ============================

in any order, as in ``laser_rocking=1@40/5.3Hz``. What is left out is the catalogue's typical size. A course
follows the effect's name, and its numbers the effect's: ``laser_tilt~step=0.6@40/4.6s``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CONSTANTLY, COURSES, Course, CourseKind, Effect, Quantity

_COURSE = "~"
_DIRECTIONS = ("direction_deg", "azimuth_deg")
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_SIZE = re.compile(rf"(?P<value>{_NUMBER})(?P<unit>[a-zA-Z]*?)(?=[@/]|x[-+.\d]|$)")
_PART = re.compile(rf"(?P<mark>[@x/])(?P<value>{_NUMBER})(?P<unit>[a-zA-Z]*?)(?=[@/]|x[-+.\d]|$)")


@dataclass(frozen=True)
class Switch:
    """An effect and its size.

    Attributes
    ----------
    name : str
        Of the catalogue.
    values : tuple of float
        The catalogue's quantities, in its order and units.
    course : Course
        How the size changes.

    Raises
    ------
    InputError
        For an unknown name, a wrong number of values, or a value out of the catalogue's range.
    """

    name: str
    values: tuple[float, ...]
    course: Course = CONSTANTLY

    def __post_init__(self) -> None:
        quantities = effect(self.name).quantities
        if len(self.values) != len(quantities):
            raise _refusal(self.name, self.name, f"{len(self.values)} values given for {len(quantities)}")
        for quantity, value in zip(quantities, self.values, strict=True):
            _require_range(self.name, quantity, value)

    @property
    def key(self) -> str:
        """Name and kind of course, as in ``laser_tilt~step``; the name alone if it is constant."""
        constant = self.course.kind is CourseKind.CONSTANT
        return self.name if constant else f"{self.name}{_COURSE}{self.course.kind}"

    @property
    def numbers(self) -> dict[str, float]:
        """Values of the effect and of its course by the name of their quantity."""
        return self.quantities | self.course.quantities

    @property
    def effect(self) -> Effect:
        """Its entry in the catalogue."""
        return effect(self.name)

    @property
    def quantities(self) -> dict[str, float]:
        """Values by the name of their quantity."""
        return {q.name: v for q, v in zip(self.effect.quantities, self.values, strict=True)}

    @property
    def text(self) -> str:
        """The switch as `parse_switch` reads it."""
        size, *others = zip(_quantities(self.key), self.numbers.values(), strict=True)
        return f"{self.key}={size[1]!r}" + "".join(_part_text(q, v) for q, v in others)

    @property
    def truth(self) -> list[object]:
        """``[name, [values...]]`` and the course if it has one, as truth.json contains it."""
        course = [{"kind": str(self.course.kind), **self.course.quantities}] if self.key != self.name else []
        return [self.name, list(self.values), *course]


def typical_switch(name: str) -> Switch:
    """Return an effect with its typical size."""
    return Switch(name, tuple(q.typical for q in effect(name).quantities))


def parse_switch(text: str) -> Switch:
    """Return the switch that a text of ``--with`` describes.

    Raises
    ------
    InputError
        Naming the quantities that the effect takes, their units and ranges.
    """
    key, equals, sizes = text.partition("=")
    values = {q.name: q.typical for q in _quantities(key)}
    if equals:
        _read_sizes(key, text, sizes, values)
    return _switch(key, values)


def _switch(key: str, values: Mapping[str, float]) -> Switch:
    name, _, kind = key.partition(_COURSE)
    sizes = tuple(values[q.name] for q in effect(name).quantities)
    return Switch(name, sizes, Course(_kind(kind), tuple(values.values())[len(sizes) :]))


def _quantities(key: str) -> tuple[Quantity, ...]:
    """Return the quantities of an effect and of its course."""
    name, _, kind = key.partition(_COURSE)
    return (*effect(name).quantities, *COURSES[_kind(kind)])


def _kind(text: str) -> CourseKind:
    kinds = [str(k) for k in CourseKind]
    if text and text not in kinds:
        raise InputError("course", f"{text!r} is not known", expected=", ".join(kinds))
    return CourseKind(text or CourseKind.CONSTANT)


def the_other_way(switch: Switch) -> Switch:
    """Return an effect of the opposite size, or of twice the size where the size has no sign.

    As an answer it is about as far from the right one as no effect at all.
    """
    values, quantities = list(switch.values), switch.effect.quantities
    direction = next((k for k, q in enumerate(quantities) if q.name in _DIRECTIONS), None)
    if direction is None:
        own = quantities[0]
        values[0] = -values[0] if own.low <= -values[0] <= own.high else 2 * values[0]
    else:
        turn = 180.0 / switch.quantities.get("order", 1.0)
        values[direction] = (values[direction] + turn + 180.0) % 360.0 - 180.0
    return Switch(switch.name, tuple(values), switch.course)


def parse_switches(texts: Sequence[str]) -> tuple[Switch, ...]:
    """Return the switches of several texts; no effect may be given twice."""
    switches = tuple(parse_switch(text) for text in texts)
    names = [switch.key for switch in switches]
    for name in names:
        if names.count(name) > 1:
            raise _refusal(name.partition(_COURSE)[0], name, "is given twice")
    return switches


def switches_from_mapping(effects: object, file: Path | str) -> tuple[Switch, ...]:
    """Return the switches of a scene file's ``effects``: name to {quantity: value}, or to nothing.

    Raises
    ------
    InputError
        For anything else, naming ``file``.
    """
    if not isinstance(effects, Mapping):
        raise InputError(file, "is no mapping", place="effects", expected="effect: {quantity: value}")
    return tuple(_from_mapping(str(name), sizes, file) for name, sizes in effects.items())


def _from_mapping(name: str, sizes: object, file: Path | str) -> Switch:
    key, name = name, name.partition(_COURSE)[0]
    values = {q.name: q.typical for q in _quantities(key)}
    given = {} if sizes is None else sizes
    if not isinstance(given, Mapping):
        raise _refusal(name, f"effects.{name}", "is no mapping", file)
    for quantity, value in given.items():
        if quantity not in values:
            raise _refusal(name, f"effects.{key}", f"has no quantity {quantity!r}", file)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _refusal(name, f"effects.{key}.{quantity}", f"{value!r} is no number", file)
        values[quantity] = float(value)
    return _switch(key, values)


def _read_sizes(key: str, text: str, sizes: str, values: dict[str, float]) -> None:
    """Put the sizes of a text into ``values``."""
    name, quantities = key.partition(_COURSE)[0], _quantities(key)
    first = _SIZE.match(sizes)
    if first is None or first["unit"] not in ("", quantities[0].unit):
        raise _refusal(name, text, f"{sizes!r} does not begin with a size")
    values[quantities[0].name] = float(first["value"])
    position, seen = first.end(), {quantities[0].name}
    while position < len(sizes):
        part = _PART.match(sizes, position)
        quantity = None if part is None else _meant(quantities[1:], part["mark"], part["unit"])
        if part is None or quantity is None or quantity.name in seen:
            raise _refusal(name, text, f"{sizes[position:]!r} is not understood")
        values[quantity.name] = float(part["value"])
        seen.add(quantity.name)
        position = part.end()


def _meant(quantities: Sequence[Quantity], mark: str, unit: str) -> Quantity | None:
    for quantity in quantities:
        wanted = {quantity.unit} if _mark(quantity) == "/" else {"", quantity.unit}
        if _mark(quantity) == mark and unit in wanted:
            return quantity
    return None


def _mark(quantity: Quantity) -> str:
    return {"direction_deg": "@", "azimuth_deg": "@", "order": "x"}.get(quantity.name, "/")


def _part_text(quantity: Quantity, value: float) -> str:
    mark = _mark(quantity)
    return f"{mark}{value!r}{quantity.unit if mark == '/' else ''}"


def _require_range(name: str, quantity: Quantity, value: float) -> None:
    whole = quantity.name != "order" or value == round(value)
    if not (math.isfinite(value) and quantity.low <= value <= quantity.high and whole):
        raise _refusal(name, quantity.name, f"{value:g} is out of range")


def _refusal(name: str, place: str, problem: str, file: Path | str = "--with") -> InputError:
    quantities = effect(name).quantities
    form = name + "=" + "".join(_form(k, q) for k, q in enumerate(quantities))
    sizes = "; ".join(
        f"{q.name} {q.low:g} to {q.high:g} {q.unit}".rstrip() + f" ({q.meaning}; typical {q.typical:g})"
        for q in quantities
    )
    return InputError(file, problem, place=place, expected=f"{form} with {sizes}")


def _form(place: int, quantity: Quantity) -> str:
    word = quantity.name.split("_")[0].upper()
    mark = _mark(quantity) if place else ""
    return f"{mark}{word}{quantity.unit if mark == '/' else ''}"
