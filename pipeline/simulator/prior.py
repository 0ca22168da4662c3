"""Scenes drawn from a prior: pairs of gauge run and inspection with one probe and its concealed effects."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, Strict, ValidationError, model_validator

from pipeline.errors import InputError
from pipeline.files.json_yaml import read_yaml
from pipeline.machine.stage import Parameters
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import COURSES, Course, CourseKind, Quantity
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.scene import Scene, read_scene, scene_from

Range = tuple[float, float]
_DIRECTION = "direction_deg"


class Pairing(Parameters):
    """A gauge scene and an inspection scene for one probe, named relative to the prior's file."""

    gauge: str = Field(min_length=1, description="scene file of the gauge run")
    field: str = Field(min_length=1, description="scene file of the inspection")
    weight: float = Field(1.0, gt=0, description="relative frequency among the choices")


class Variation(Parameters):
    """One number of the scenes that varies from draw to draw."""

    key: str = Field(min_length=1, description="dotted key in the scene, list positions as numbers")
    low: float = Field(description="smallest value")
    high: float = Field(description="largest value")
    of: Literal["both", "gauge", "field"] = Field("both", description="both: one draw for the two scenes")


class Concealable(Parameters):
    """An effect that may be concealed, and its range of sizes."""

    name: str = Field(description="name of the effect in the catalogue")
    weight: float = Field(1.0, gt=0, description="relative frequency among the choices")
    size: Range = Field((1.0, 6.0), description="its first quantity over the typical, drawn log-uniformly")
    course: Annotated[CourseKind, Strict(False)] = Field(
        CourseKind.CONSTANT, description="how the size changes during a recording"
    )
    others: dict[str, Range] = Field(
        default_factory=dict,
        description="ranges of further quantities, the course's among them, drawn evenly; else the typical",
    )

    @model_validator(mode="after")
    def _in_catalogue(self) -> Concealable:
        known = [q.name for q in self.quantities]
        unknown = sorted(set(self.others) - set(known[1:]))
        if unknown:
            raise ValueError(f"{self.name} has no quantity {unknown[0]!r} beside its size")
        if not 0 < self.size[0] <= self.size[1]:
            raise ValueError(f"{self.name}: size must be two positive numbers, the smaller first")
        return self

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The quantities of the effect, followed by those of its course."""
        return (*effect(self.name).quantities, *COURSES[self.course])


class Prior(Parameters):
    """The distribution from which scenes are drawn."""

    name: str = Field(min_length=1, pattern=r"^[\w-]+$", description="first part of the recordings' names")
    pairs: tuple[Pairing, ...] = Field(min_length=1, description="scenes to start from")
    vary: tuple[Variation, ...] = Field((), description="numbers that differ from draw to draw")
    concealed: tuple[float, ...] = Field(
        (0.25, 0.6, 0.15), min_length=1, max_length=4, description="probability of 0, 1, 2 … effects"
    )
    effects: tuple[Concealable, ...] = Field((), description="effects that may be concealed")


@dataclass(frozen=True)
class DrawnPair:
    """Two scenes of one probe; ``folder`` is where a photograph of either is searched."""

    gauge: Scene
    field: Scene
    folder: Path


def read_prior(file: Path) -> Prior:
    """Read a prior file.

    Raises
    ------
    InputError
        At the key that is unknown, mistyped or out of range.
    """
    try:
        return Prior.model_validate_json(json.dumps(dict(read_yaml(file).values)))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(file, first["msg"], place=f"key {place}") from error


def draw_pair(prior: Prior, file: Path, seed: int, index: int) -> DrawnPair:
    """Return pair number ``index`` of a prior read from ``file``; the same for the same seed.

    Raises
    ------
    InputError
        When a scene cannot be read, or a draw takes it out of its ranges.
    """
    random = np.random.default_rng([seed, index])
    chosen = prior.pairs[_weighted(random, [p.weight for p in prior.pairs])]
    own = [random.integers(0, 2**31 - 1) for _ in range(3)]
    scenes = {}
    changes = _draw_variations(prior.vary, random)
    effects = _draw_effects(prior, random)
    for kind, source, seed_of_wall in (("gauge", chosen.gauge, own[0]), ("field", chosen.field, own[1])):
        scene = read_scene(file.parent / source)
        values = scene.model_dump(mode="json", exclude_defaults=True)
        values |= {
            "name": f"{prior.name}-{index + 1:03d}-{kind}",
            "seed": int(seed_of_wall),
            "probe_seed": int(own[2]),
            "effects": dict(values.get("effects", {})) | effects,
        }
        for key, value in changes[kind]:
            _set(values, key, value, file)
        scenes[kind] = scene_from(values, file)
    return DrawnPair(scenes["gauge"], scenes["field"], (file.parent / chosen.field).parent)


def _draw_variations(
    vary: Sequence[Variation], random: np.random.Generator
) -> dict[str, list[tuple[str, float]]]:
    drawn: dict[str, list[tuple[str, float]]] = {"gauge": [], "field": []}
    for variation in vary:
        value = round(float(random.uniform(variation.low, variation.high)), 6)
        for kind in ("gauge", "field") if variation.of == "both" else (variation.of,):
            drawn[kind].append((variation.key, value))
    return drawn


def _draw_effects(prior: Prior, random: np.random.Generator) -> dict[str, dict[str, float]]:
    """Return the concealed effects; none is drawn twice, nor together with one that looks the same."""
    left = list(prior.effects)
    drawn: dict[str, dict[str, float]] = {}
    for _ in range(_weighted(random, prior.concealed)):
        if not left:
            break
        one = left[_weighted(random, [e.weight for e in left])]
        switch = _draw_sizes(one, random)
        drawn[switch.key] = switch.numbers
        left = [e for e in left if e.name not in (one.name, *effect(one.name).alike)]
    return drawn


def _draw_sizes(one: Concealable, random: np.random.Generator) -> Switch:
    size, *others = one.quantities
    factor = float(np.exp(random.uniform(*np.log(one.size))))
    sign = float(random.choice([-1.0, 1.0])) if size.low < 0 else 1.0
    values = {size.name: _fit(size, sign * factor * size.typical)}
    for quantity in others:
        span = one.others.get(quantity.name, (-180.0, 180.0) if quantity.name == _DIRECTION else None)
        value = float(random.uniform(*span)) if span else quantity.typical
        values[quantity.name] = _fit(quantity, float(np.rint(value)) if quantity.name == "order" else value)
    own = len(effect(one.name).quantities)
    numbers = tuple(values.values())
    return Switch(one.name, numbers[:own], Course(one.course, numbers[own:]))


def _fit(quantity: Quantity, value: float) -> float:
    return float(f"{min(max(value, quantity.low), quantity.high):.6g}")


def _weighted(random: np.random.Generator, weights: Sequence[float]) -> int:
    share = np.asarray(weights, float)
    return int(random.choice(len(share), p=share / share.sum()))


def _set(values: dict[str, Any], key: str, value: float, file: Path) -> None:
    """Set a number at a dotted key of a scene's mapping, in lists by index; missing mappings are added."""
    *way, last = key.split(".")
    at: Any = values
    for part in way:
        at = at[int(part)] if isinstance(at, list) else at.setdefault(part, {})
    try:
        at[int(last) if isinstance(at, list) else last] = value
    except (IndexError, ValueError, TypeError) as error:
        raise InputError(file, f"varies {key!r}, which no scene has", place="key vary") from error
