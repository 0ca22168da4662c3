"""Stages are connected by type before anything runs; keys change with everything that a result depends on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import pytest

from pipeline.machine.configuration import resolve
from pipeline.machine.plan import PipelineError, Plan, Source, make_plan
from pipeline.machine.stage import Context, Of, Parameters, Stage, of_role
from pipeline.recording.base import Recording
from tests.toy_stages import DRAW, SMOOTH, TOTAL, TOYS, WEIGH, Drawn, Total
from tests.toys import toy_recording


def plan_of(*stages: Stage, key: str = "0" * 64, assignments: tuple[str, ...] = ()) -> Plan:
    recording = toy_recording()
    return make_plan(stages, resolve(stages, None, assignments), (Source(Recording, recording, key),))


def keys(plan: Plan) -> list[str]:
    return [s.key for s in plan.steps]


@pytest.mark.parametrize(
    ("stages", "message"),
    [
        ((SMOOTH, DRAW, TOTAL), "stage smooth needs Drawn: stage draw, which must come before"),
        ((DRAW, TOTAL), "stage total needs Smoothed: no stage makes it"),
        ((DRAW, replace(DRAW, name="again")), "stage again makes Drawn, which exists already"),
        ((DRAW, DRAW), "two stages are named draw"),
    ],
)
def test_stages_that_cannot_be_connected_are_refused(stages: tuple[Stage, ...], message: str) -> None:
    with pytest.raises(PipelineError, match=message):
        plan_of(*stages)


def test_a_missing_source_is_refused() -> None:
    with pytest.raises(PipelineError, match="stage draw needs Recording: no stage makes it"):
        make_plan(TOYS, resolve(TOYS), ())


def test_the_same_plan_has_the_same_keys() -> None:
    assert keys(plan_of(*TOYS)) == keys(plan_of(*TOYS))
    assert len(set(keys(plan_of(*TOYS)))) == len(TOYS)


def test_a_parameter_changes_the_keys_from_its_stage_on() -> None:
    before, after = keys(plan_of(*TOYS)), keys(plan_of(*TOYS, assignments=("smooth.width=5",)))
    assert [a == b for a, b in zip(before, after, strict=True)] == [True, False, False]


def test_a_version_changes_the_keys_from_its_stage_on() -> None:
    before, after = keys(plan_of(*TOYS)), keys(plan_of(DRAW, replace(SMOOTH, version="2"), TOTAL))
    assert [a == b for a, b in zip(before, after, strict=True)] == [True, False, False]


def test_another_recording_changes_every_key() -> None:
    before, after = keys(plan_of(*TOYS)), keys(plan_of(*TOYS, key="1" * 64))
    assert not set(before) & set(after)


@dataclass(frozen=True)
class Both:
    difference: float


def compare(
    total: Total, other: Annotated[Total, Of("gauge")], *, parameters: Parameters, context: Context
) -> Both:
    return Both(total.total - other.total)


def two_recordings(first: str, second: str) -> Plan:
    sources = [
        Source(of_role(Recording, role), replace(toy_recording(), content_key=key), key)
        for role, key in (("", first), ("gauge", second))
    ]
    stages = (*TOYS, *(s.for_role("gauge") for s in TOYS), Stage("compare", "1", Parameters, compare))
    return make_plan(stages, resolve(stages), sources)


def test_stages_of_two_recordings_are_separate() -> None:
    plan = two_recordings("a" * 64, "b" * 64)
    names = [s.stage.label for s in plan.steps]
    assert names == ["draw", "smooth", "total", "gauge draw", "gauge smooth", "gauge total", "compare"]
    assert plan.input_hashes() == {"recording": "a" * 64, "gauge": "b" * 64}
    assert plan.step("gauge total").output == of_role(Total, "gauge")
    assert plan.step("total").key != plan.step("gauge total").key


def test_a_result_has_one_key_in_every_role() -> None:
    one, swapped = two_recordings("a" * 64, "b" * 64), two_recordings("b" * 64, "a" * 64)
    assert one.step("gauge total").key == swapped.step("total").key
    assert one.step("total").key == swapped.step("gauge total").key
    assert one.step("compare").key != swapped.step("compare").key


def test_a_seed_depends_only_on_the_inputs_of_the_result() -> None:
    one, other = two_recordings("a" * 64, "b" * 64), two_recordings("a" * 64, "c" * 64)
    assert one.step("draw").seed == other.step("draw").seed
    assert one.step("gauge draw").seed != other.step("gauge draw").seed


def test_an_optional_input_is_none_where_no_stage_makes_it_and_waited_for_where_one_does() -> None:
    alone, both = plan_of(DRAW, WEIGH).step("weigh"), plan_of(*TOYS, WEIGH).step("weigh")
    assert dict(alone.inputs) == {"drawn": Drawn}
    assert dict(both.inputs) == {"drawn": Drawn, "total": Total}
    assert alone.key != both.key
    with pytest.raises(PipelineError, match="stage weigh needs Total: stage total, which must come before"):
        plan_of(DRAW, SMOOTH, WEIGH, TOTAL)
