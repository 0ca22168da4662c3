"""Drawn gauge runs at ring level: the effects concealed in each, and the noise of its measurements."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import COURSES, Course, CourseKind
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch, switches_from_mapping
from pipeline.simulator.laws import bench_truth
from pipeline.simulator.prior import Concealable, Prior, draw_pair, read_prior
from pipeline.simulator.scene import Scene
from tests.benchmarks.ring_level import Noise

PRIOR = Path(__file__).with_name("ring_level.yaml")
# Fewer frames at a lower rate: the same distance and time with less computing.
_FRAMES = 1 / 3
_TEXEL_MM = 1.0
_REPEATED = "sheet_waviness"
_BORE_MM = 50.8
# Courses that are drawn; swings are drawn as `laser_rocking` and similar effects.
_COURSES = (
    CourseKind.STEP, CourseKind.RAMP, CourseKind.EXPONENTIAL, CourseKind.SPEED, CourseKind.REVERSAL,
    CourseKind.DISTANCE,
)  # fmt: skip
_OF_THEIR_OWN = {(law, CourseKind.EXPONENTIAL) for law in ("baseline", "focal_scale", "principal_point")}


class Mode(StrEnum):
    """What is concealed, and whether the library knows it."""

    NULLS = "nulls"
    SINGLES = "singles"
    PAIRS = "pairs"
    LEFTOUT = "leftout"
    COURSES = "courses"
    SEVERAL = "several"


@dataclass(frozen=True)
class Drawn:
    """A case: its gauge scene, what is switched on, and the noise of its measurements."""

    scene: Scene
    file: Path
    switches: tuple[Switch, ...]
    noise: Noise


def drawn(mode: Mode, seed: int) -> Drawn:
    """Return case ``seed`` of a mode; single effects come in turn, so that all come equally often."""
    prior = read_prior(PRIOR)
    turn = prior.effects[seed % len(prior.effects)]
    drawn_here = (Mode.SINGLES, Mode.LEFTOUT)
    concealed = (0.0, 1.0) if mode in drawn_here else (0.0, 0.0, 1.0) if mode is Mode.PAIRS else (1.0,)
    changes: dict[str, object] = {"concealed": concealed}
    if mode in drawn_here:
        changes["effects"] = (turn,)
    pair = draw_pair(prior.model_copy(update=changes), PRIOR, seed, list(Mode).index(mode))
    random = np.random.default_rng([seed, 11])
    louder = random.uniform(0.7, 1.5, 3)
    noise = Noise(0.05 * louder[0], 0.02 * louder[1], 0.07 * louder[2], 0.05 * louder[1])
    frames = round(_FRAMES * pair.gauge.frames)
    rate = _FRAMES * pair.gauge.frame_rate
    # Ring-level runs do not use the wall's paint, so that coarse texels suffice.
    pipe = pair.gauge.pipe.model_copy(update={"texel_mm": _TEXEL_MM})
    scene = pair.gauge.model_copy(update={"frames": frames, "frame_rate": rate, "pipe": pipe, "effects": {}})
    switches = switches_from_mapping(pair.gauge.effects, PRIOR)
    if mode is Mode.COURSES:
        switches = (_with_course(prior, seed, frames / rate),)
    if mode is Mode.SEVERAL:
        switches = _several(prior, seed)
    return Drawn(scene, pair.folder / "scene.yaml", switches, noise)


@cache
def with_a_course() -> tuple[tuple[str, CourseKind], ...]:
    """Return steady effects of the prior with each course that the simulator can give them.

    Whether the diagnosis searches them makes no difference. A combination that the catalogue has as a
    separate effect comes under that name among the single effects.
    """
    scene, out = bench_truth(_BORE_MM), []
    for one in read_prior(PRIOR).effects:
        for kind in _COURSES if effect(one.name).time == "static" else ():
            numbers = tuple(q.typical for q in COURSES[kind])
            values = tuple(q.typical for q in effect(one.name).quantities)
            try:
                switch_on(scene, [Switch(one.name, values, Course(kind, numbers))])
            except InputError:
                continue
            out += [(one.name, kind)] if (one.name, kind) not in _OF_THEIR_OWN else []
    return tuple(out)


def _with_course(prior: Prior, seed: int, duration_s: float) -> Switch:
    """Return a law with a course, both drawn; laws and courses come in turn."""
    random = np.random.default_rng([seed, 13])
    pairs = with_a_course()
    name, kind = pairs[int(random.integers(len(pairs)))]
    size = next(e.size for e in prior.effects if e.name == name)
    values = {q.name: q.typical for q in effect(name).quantities}
    first = effect(name).quantities[0]
    sign = random.choice([-1.0, 1.0]) if first.low < 0 else 1.0
    values[first.name] *= float(sign * np.exp(random.uniform(*np.log(size))))
    values |= {"direction_deg": float(random.uniform(-180, 180))} if "direction_deg" in values else {}
    values |= {"order": float(random.integers(2, 4))} if "order" in values else {}
    numbers = {
        CourseKind.STEP: (random.uniform(0.15, 0.85) * duration_s,), CourseKind.RAMP: (duration_s,),
        CourseKind.EXPONENTIAL: (random.uniform(0.15, 0.6) * duration_s,), CourseKind.SPEED: (20.0,),
        CourseKind.DISTANCE: (100.0,),
    }.get(kind, ())  # fmt: skip
    return Switch(name, tuple(values.values()), Course(kind, tuple(map(float, numbers))))


def _several(prior: Prior, seed: int) -> tuple[Switch, ...]:
    """Return two to four effects: in turn any, with two that look the same, and with one law twice."""
    random = np.random.default_rng([seed, 17])
    known = {e.name: e for e in prior.effects}
    first = known[_REPEATED] if seed % 3 == 2 else known[str(random.choice(list(known)))]
    like = [n for n in effect(first.name).alike if n in known]
    second = first if seed % 3 == 2 else known[str(random.choice(like if like and seed % 3 else list(known)))]
    chosen = [first] if second is first and first.name != _REPEATED else [first, second]
    others = [e for e in prior.effects if e not in chosen]
    more = random.permutation(len(others))[: 2 + int(random.integers(0, 3)) - len(chosen)]
    chosen += [others[k] for k in more]
    return tuple(_switch(prior, one, seed, k) for k, one in enumerate(chosen))


def _switch(prior: Prior, one: Concealable, seed: int, place: int) -> Switch:
    """Return an effect with drawn sizes; two sheet waves get different orders."""
    if one.name == _REPEATED:
        one = one.model_copy(update={"others": {"order": (2.0 + place % 3, 2.0 + place % 3)}})
    alone = prior.model_copy(update={"concealed": (0.0, 1.0), "effects": (one,)})
    return switches_from_mapping(draw_pair(alone, PRIOR, seed, 100 + place).gauge.effects, PRIOR)[0]
