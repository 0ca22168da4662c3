"""The typed, strict configuration of a run: the parameters of every stage, and their origin."""

from __future__ import annotations

import difflib
import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from pipeline.errors import InputError
from pipeline.files.codec import Json
from pipeline.files.json_yaml import read_yaml
from pipeline.machine.stage import Parameters, Stage

# The section with the machines of a batch; it belongs to no stage and is read by
# `pipeline.batch.cluster`.
CLUSTER = "cluster"
_COMMAND_LINE = "--set"
_WIDTH = 110
_EXPONENT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")


@dataclass(frozen=True)
class StageConfiguration:
    """The parameters of one stage."""

    stage: str
    parameters: Parameters


@dataclass(frozen=True)
class Configuration:
    """The parameters of every stage, in the order of the pipeline."""

    stages: tuple[StageConfiguration, ...]

    def of(self, stage: str) -> Parameters:
        """Return the parameters in the section of a stage."""
        return next(s.parameters for s in self.stages if s.stage == stage)

    def tree(self) -> dict[str, Json]:
        """Return all parameters as plain data, by section."""
        return {s.stage: s.parameters.model_dump(mode="json") for s in self.stages}


@dataclass(frozen=True)
class _Setting:
    """One value that a user set, and its place."""

    origin: Path
    place: str
    value: Any


def resolve(
    stages: Sequence[Stage],
    file: Path | None = None,
    assignments: Sequence[str] = (),
    earlier: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    earlier_file: Path = Path("run.json"),
) -> Configuration:
    """Return the configuration: defaults, overridden by ``file``, overridden by ``assignments``.

    Parameters
    ----------
    stages
        Stages of the run.
    file
        YAML: a mapping of stage names to mappings of parameter names to values, and perhaps `CLUSTER`.
    assignments
        ``stage.parameter=value`` each, the value in YAML.
    earlier, earlier_file
        Parameters of an earlier run by stage, which replace the defaults, and their file.

    Raises
    ------
    InputError
        For a file that cannot be read, an unknown key (naming the nearest right one) or a value of the
        wrong type or out of range.
    """
    settings = [
        *(_Setting(earlier_file, f"{s}.{name}", v) for s, own in earlier.items() for name, v in own.items()),
        *(_settings_of_file(file) if file else ()),
        *(_setting_of(a) for a in assignments),
    ]
    known = [f"{s.configured_as}.{p}" for s in stages for p in s.parameters.model_fields]
    for setting in settings:
        _check_known(setting, known)
    sections = {s.configured_as: s for s in stages}
    return Configuration(
        tuple(StageConfiguration(name, _parameters_of(s, settings)) for name, s in sections.items())
    )


def default_text(stages: Sequence[Stage]) -> str:
    """Return the default configuration as commented YAML: meaning, unit and range of every parameter."""
    head = "# Default configuration, made from the program: boresight config --default\n"
    return head + "".join(f"\n{_stage_text(s)}" for s in stages)


def resolved_text(configuration: Configuration) -> str:
    """Return a configuration as plain YAML."""
    return yaml.safe_dump(configuration.tree(), sort_keys=False, allow_unicode=True)


def _settings_of_file(file: Path) -> Iterator[_Setting]:
    for stage, content in read_yaml(file).values.items():
        if stage == CLUSTER:
            continue
        if not isinstance(content, Mapping):
            raise InputError(
                file,
                f"{content!r} instead of the parameters of a stage",
                place=str(stage),
                expected="stage: {parameter: value}",
                hint="see boresight config --default",
            )
        yield from (_Setting(file, f"{stage}.{name}", value) for name, value in content.items())


def _setting_of(assignment: str) -> _Setting:
    place, equals, text = assignment.partition("=")
    if not equals or "." not in place:
        raise InputError(
            _COMMAND_LINE, f"{assignment!r} is not an assignment", expected="stage.parameter=value"
        )
    try:
        return _Setting(Path(_COMMAND_LINE), place.strip(), yaml.safe_load(text))
    except yaml.YAMLError as error:
        raise InputError(_COMMAND_LINE, f"{text!r} is not a value", place=place) from error


def _check_known(setting: _Setting, known: Sequence[str]) -> None:
    if setting.place in known:
        return
    nearest = difflib.get_close_matches(setting.place, known, n=1, cutoff=0.0)
    raise InputError(
        setting.origin,
        "unknown key",
        place=setting.place,
        hint=f"did you mean {nearest[0]}? All keys: boresight config" if nearest else "",
    )


def _parameters_of(stage: Stage, settings: Sequence[_Setting]) -> Parameters:
    mine = {
        s.place.partition(".")[2]: s for s in settings if s.place.partition(".")[0] == stage.configured_as
    }
    try:
        # Through JSON: strict, but a YAML list may become a tuple and a word an enumeration member.
        return stage.parameters.model_validate_json(
            json.dumps({name: _number(s.value) for name, s in mine.items()}, default=str)
        )
    except ValidationError as error:
        raise _refusal(stage, mine, error) from error


def _number(value: Any) -> Any:
    """Convert numbers that YAML 1.1 reads as words, such as 1e-3; return anything else unchanged."""
    if isinstance(value, list):
        return [_number(v) for v in value]
    return float(value) if isinstance(value, str) and _EXPONENT.fullmatch(value) else value


def _refusal(stage: Stage, mine: Mapping[str, _Setting], error: ValidationError) -> InputError:
    first = error.errors(include_url=False)[0]
    name = str(first["loc"][0]) if first["loc"] else ""
    origin = mine[name].origin if name in mine else Path(_COMMAND_LINE)
    field = stage.parameters.model_fields.get(name)
    return InputError(
        origin,
        f"{first['msg']}, not {mine[name].value!r}" if name in mine else first["msg"],
        place=f"{stage.configured_as}.{name}" if name else stage.configured_as,
        expected=_meaning(field) if field else "",
    )


def _stage_text(stage: Stage) -> str:
    head = _comment(stage.summary, "") + f"{stage.name}:"
    model = stage.parameters()
    lines = [_field_text(n, f, model) for n, f in stage.parameters.model_fields.items()]
    return f"{head}\n{''.join(lines)}" if lines else f"{head} {{}}\n"


def _field_text(name: str, field: FieldInfo, model: Parameters) -> str:
    value = model.model_dump(mode="json")[name]
    return _comment(_meaning(field), "  ") + f"  {name}: {json.dumps(value, ensure_ascii=False)}\n"


def _meaning(field: FieldInfo) -> str:
    limits = [
        f"{word} {getattr(m, name)}"
        for m in field.metadata
        for name, word in (("ge", "from"), ("gt", "above"), ("le", "to"), ("lt", "below"))
        if hasattr(m, name)
    ]
    return "; ".join(p for p in (field.description or "", " ".join(limits)) if p)


def _comment(text: str, indent: str) -> str:
    lines = textwrap.wrap(text, _WIDTH - len(indent) - 2)
    return "".join(f"{indent}# {line}\n" for line in lines)
