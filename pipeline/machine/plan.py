"""The plan of a run: stages wired by the types of their arguments, and the key of every result."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pipeline.errors import BoresightError
from pipeline.files.codec import OWN_PACKAGES, Json, canonical
from pipeline.machine.configuration import Configuration
from pipeline.machine.stage import Parameters, Stage, of_role, plain, role_of


class PipelineError(BoresightError):
    """Stages do not fit together; raised before anything runs."""


@dataclass(frozen=True)
class Source:
    """An input of the run.

    Attributes
    ----------
    kind
        The class by which stages request it.
    value
        The object itself.
    key
        Hash of its content; empty for a missing input, such as a gauge run that was not made.
    refuse_changed
        Raises `pipeline.errors.InputError` when the content is no longer that of the key.
    """

    kind: type
    value: object
    key: str
    refuse_changed: Callable[[], None] = field(default=lambda: None, repr=False, compare=False)


@dataclass(frozen=True)
class Step:
    """A stage placed in a plan.

    Attributes
    ----------
    stage, parameters
    inputs
        Argument names with their classes.
    output
        Class of its result.
    key
        Hash of everything on which the result depends.
    seed
        Seed of its random numbers: the same for equal parameters and sources, whatever the program text.
    """

    stage: Stage
    parameters: Parameters
    inputs: tuple[tuple[str, type], ...]
    output: type
    key: str
    seed: int


@dataclass(frozen=True)
class Plan:
    """The sources of a run and its steps, in a valid order."""

    sources: tuple[Source, ...]
    steps: tuple[Step, ...]

    def step(self, name: str) -> Step:
        """Return the step of a stage.

        Raises
        ------
        PipelineError
            When there is no such stage.
        """
        for step in self.steps:
            if step.stage.label == name:
                return step
        raise PipelineError(f"no stage {name}; there are {', '.join(s.stage.label for s in self.steps)}")

    def maker(self, kind: type) -> Step | None:
        """Return the step that makes artefacts of class ``kind``, None for a source."""
        return next((s for s in self.steps if s.output == kind), None)

    def input_hashes(self) -> dict[str, str]:
        """Return the hash of every source by name: ``recording``, ``probe``, or a role such as ``gauge``."""
        return {role_of(s.kind) or plain(s.kind).__name__.lower(): s.key for s in self.sources if s.key}

    def key(self) -> str:
        """Return a common key of all results."""
        return hashlib.sha256("".join(s.key for s in self.steps).encode()).hexdigest()

    def keys(self) -> dict[type, str]:
        """Return the key of every source and result by its class."""
        return {s.kind: s.key for s in self.sources} | {s.output: s.key for s in self.steps}


@dataclass(frozen=True)
class Selection:
    """Which stages to run.

    Attributes
    ----------
    recompute_from
        Compute this stage and all after it again; empty to reuse all existing results.
    only
        Run this stage alone; empty for all.
    resume
        False to compute everything again.
    """

    recompute_from: str = ""
    only: str = ""
    resume: bool = True

    def check(self, plan: Plan) -> None:
        """Raise `PipelineError` when a stage named is not in the plan."""
        for name in filter(None, (self.recompute_from, self.only)):
            plan.step(name)

    def skips(self, step: Step) -> bool:
        """Return whether a step must not be computed even if its result is missing."""
        return bool(self.only) and step.stage.label != self.only

    def recomputes(self, step: Step, plan: Plan) -> bool:
        """Return whether a step must be computed even if its result exists."""
        if self.skips(step):
            return False
        names = [s.stage.label for s in plan.steps]
        since = self.recompute_from
        return not self.resume or (bool(since) and names.index(step.stage.label) >= names.index(since))


def make_plan(stages: Sequence[Stage], configuration: Configuration, sources: Sequence[Source]) -> Plan:
    """Wire the stages and derive their keys.

    The key of a result is a hash of stage name, version, program text, parameters and keys of the inputs.

    Raises
    ------
    PipelineError
        When a stage needs an artefact that no earlier stage makes, or two make the same.
    """
    keys = {s.kind: s.key for s in sources}
    made_from = {s.kind: {s.kind} for s in sources}
    steps: list[Step] = []
    for stage in stages:
        _check_wiring(stage, keys, stages)
        inputs = _wired(stage, keys, stages)
        parameters = configuration.of(stage.configured_as)
        key = _key(stage, parameters, {name: keys[kind] for name, kind in inputs.items()})
        origins = set[type]().union(*(made_from[kind] for kind in inputs.values()))
        seed = _seed(stage, parameters, [s.key for s in sources if s.kind in origins])
        steps.append(Step(stage, parameters, tuple(inputs.items()), stage.output(), key, seed))
        keys[stage.output()], made_from[stage.output()] = key, origins
    return Plan(tuple(sources), tuple(steps))


def _found(kind: type, stage: Stage, made: Mapping[type, str]) -> type:
    """Return the class of the stage's own recording where a step makes it, else the class all share."""
    own = of_role(kind, stage.role) if kind == plain(kind) else kind
    return own if own in made else kind


def _wired(stage: Stage, made: Mapping[type, str], stages: Sequence[Stage]) -> dict[str, type]:
    """Return the class of each argument of a stage; optional arguments that no stage makes are left out."""
    found = {name: _found(kind, stage, made) for name, kind in stage.inputs().items()}
    known = {*made, *(s.output() for s in stages)}
    return {name: kind for name, kind in found.items() if kind in known or name not in stage.may_lack()}


def _check_wiring(stage: Stage, made: Mapping[type, str], stages: Sequence[Stage]) -> None:
    if [s.label for s in stages].count(stage.label) > 1:
        raise PipelineError(f"two stages are named {stage.label}")
    if stage.output() in made:
        name = plain(stage.output()).__name__
        raise PipelineError(f"stage {stage.label} makes {name}, which exists already")
    for kind in _wired(stage, made, stages).values():
        if kind not in made:
            makers = [s.label for s in stages if s.output() == kind]
            why = f"stage {makers[0]}, which must come before, makes it" if makers else "no stage makes it"
            raise PipelineError(f"stage {stage.label} needs {plain(kind).__name__}: {why}")


def _key(stage: Stage, parameters: Parameters, inputs: Mapping[str, Json]) -> str:
    content: Json = {
        "stage": stage.name,
        "version": stage.version,
        "source": source_digest(stage.function),
        "parameters": parameters.model_dump(mode="json"),
        "inputs": dict(inputs),
    }
    return hashlib.sha256(canonical(content)).hexdigest()


def _seed(stage: Stage, parameters: Parameters, sources: Sequence[str]) -> int:
    content: Json = [stage.name, parameters.model_dump(mode="json"), list(sources)]
    return int(hashlib.sha256(canonical(content)).hexdigest(), 16)


_IMPORT = re.compile(
    r"^[ \t]*(?:from\s+([\w.]+)\s+import\s+(\([^)]*\)|[^\n]*)|import\s+([^\n]*))", re.MULTILINE
)


def source_digest(function: Callable[..., Any]) -> str:
    """Return a SHA-256 of a function's module and of all modules of this program that it imports.

    Only modules of the packages ``pipeline``, ``stages`` and the function's own are included: libraries are
    pinned by the lock file. Imports are followed as written, also those inside functions.
    """
    packages = {*OWN_PACKAGES, function.__module__.partition(".")[0]}
    digests: dict[str, bytes] = {}
    met, waiting = set[str](), [function.__module__]
    while waiting:
        name = waiting.pop()
        if name in met or name.partition(".")[0] not in packages:
            continue
        met.add(name)
        file = _file(name)
        if file is not None:
            stat = file.stat()
            text = _read(file, stat.st_mtime_ns, stat.st_size)
            digests[name] = text.digest
            waiting.extend([name.rpartition(".")[0], *text.imported])
    total = hashlib.sha256()
    for name, digest in sorted(digests.items()):
        total.update(name.encode() + b"\0" + digest)
    return total.hexdigest()


def _file(module: str) -> Path | None:
    """Return the file of a module, found without importing the packages above it; None without one."""
    package, *inner = module.split(".")
    try:
        spec = find_spec(package)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    if not inner:
        places = [Path(spec.origin)] if spec.origin is not None and spec.origin.endswith(".py") else []
    else:
        roots = [Path(root, *inner) for root in spec.submodule_search_locations or ()]
        places = [p for root in roots for p in (root / "__init__.py", root.parent / f"{root.name}.py")]
    return next((place for place in places if place.is_file()), None)


@dataclass(frozen=True)
class _Text:
    """SHA-256 of a module's text, and the modules that it imports."""

    digest: bytes
    imported: tuple[str, ...]


@cache
def _read(file: Path, changed_ns: int, size: int) -> _Text:
    """Return digest and imports of a file, read once per modification time and size."""
    text = file.read_text(encoding="utf-8")
    return _Text(hashlib.sha256(text.encode()).digest(), tuple(_imported(text)))


def _imported(text: str) -> Iterator[str]:
    """Yield the modules, and names that may be modules, that a text imports."""
    for package, names, modules in _IMPORT.findall(text):
        yield from re.findall(r"[\w.]+", modules)
        if package:
            yield package
            yield from (f"{package}.{name}" for name in re.findall(r"\w+", names))
