"""The configuration is typed and strict, and its errors name the nearest right key."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pipeline.errors import InputError
from pipeline.machine.configuration import default_text, resolve, resolved_text
from stages.catalogue import PIPELINE
from tests.shared_data import PROJECT_ROOT
from tests.toy_stages import TOYS, DrawParameters, Mood, SmoothParameters, TotalParameters


def test_assignments_override_the_file_and_the_file_overrides_defaults(tmp_path: Path) -> None:
    file = tmp_path / "c.yaml"
    file.write_text("draw: {count: 5, mood: wild}\nsmooth: {width: 9}\ntotal: {weights: [2, 1e-3]}\n")
    configuration = resolve(TOYS, file, ["draw.count=6", "smooth.unusable_above=1e3"])
    assert configuration.of("draw") == DrawParameters(count=6, mood=Mood.WILD)
    assert configuration.of("smooth") == SmoothParameters(width=9, unusable_above=1000.0)
    assert configuration.of("total") == TotalParameters(weights=(2.0, 0.001))


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("draw.cuont=3", r"draw\.cuont: unknown key\n.*did you mean draw\.count\?"),
        ("drew.count=3", r"did you mean draw\.count\?"),
        ("width=3", "is not an assignment"),
        ("draw.count", "is not an assignment"),
        (
            "draw.count=many",
            r"draw\.count: .*integer.*not 'many'\nExpected: numbers drawn; from 1 to 5000000",
        ),
        ("draw.count=2.5", r"draw\.count: .*integer"),
        ("draw.count=true", r"draw\.count: .*integer"),
        ("draw.count='3'", r"draw\.count: .*integer"),
        ("draw.count=0", "greater than or equal to 1"),
        ("draw.count=", "integer, not None"),
        ("draw.mood=sad", r"draw\.mood: .*'calm' or 'wild'"),
        ("smooth.unusable_above=.nan", r"smooth\.unusable_above"),
        ("smooth.unusable_above=.inf", r"smooth\.unusable_above"),
        ("total.weights=[1, x]", r"total\.weights: .*number"),
        ("total.weights=[1", "is not a value"),
    ],
)
def test_wrong_assignments_are_refused_by_name(assignment: str, message: str) -> None:
    with pytest.raises(InputError, match=f"(?s)--set.*{message}"):
        resolve(TOYS, None, [assignment])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("draw: {cuont: 3}", r"draw\.cuont: unknown key\n.*draw\.count"),
        ("draw: 3", "draw: 3 instead of the parameters of a stage"),
        ("draw: {count: 3, count: 4}", "twice"),
        ("- 3", "a list at its top level"),
        ("draw: {count: [}", "not valid YAML"),
    ],
)
def test_wrong_files_are_refused_by_name(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "c.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=f"(?s)c.yaml.*{message}"):
        resolve(TOYS, file)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no\.yaml: cannot be read"):
        resolve(TOYS, tmp_path / "no.yaml")


@pytest.mark.parametrize("stages", [TOYS, PIPELINE])
def test_default_and_resolved_texts_read_back_as_the_defaults(tmp_path: Path, stages: tuple) -> None:  # type: ignore[type-arg]
    for text in (default_text(stages), resolved_text(resolve(stages))):
        file = tmp_path / "c.yaml"
        file.write_text(text)
        assert resolve(stages, file) == resolve(stages)


def test_every_parameter_has_a_description() -> None:
    for stage in PIPELINE:
        for name, field in stage.parameters.model_fields.items():
            assert field.description, f"{stage.name}.{name}"


def test_the_default_file_is_up_to_date() -> None:
    text = (PROJECT_ROOT / "configs" / "default.yaml").read_text("utf-8")
    assert text == default_text(PIPELINE), "run: boresight config --default > configs/default.yaml"
    assert list(yaml.safe_load(text)) == [s.name for s in PIPELINE]


def test_the_configuration_for_long_pipes_is_valid_and_differs_from_the_default_in_every_line() -> None:
    file = PROJECT_ROOT / "configs" / "long.yaml"
    long, usual = resolve(PIPELINE, file), resolve(PIPELINE)
    for stage, named in yaml.safe_load(file.read_text("utf-8")).items():
        for name in named:
            assert getattr(long.of(stage), name) != getattr(usual.of(stage), name), f"{stage}.{name}"
