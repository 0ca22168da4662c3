"""Which hypotheses about a gauge run are weighed, and how often."""

from collections import Counter
from types import SimpleNamespace
from typing import Any

import pytest

from stages.diagnose.gauge import judge as judging


def hypothesis(name: str, deviance: float) -> Any:
    fit = SimpleNamespace(terms=(), name=name)
    return SimpleNamespace(fit=fit, deviance=deviance, prior_deviance=0.0, named=True, library_terms=())


@pytest.mark.parametrize(
    ("likelier", "with_pattern", "ranked_as"),
    [
        ([], 1.0, ["tilt", "tilt and pattern", "nothing"]),
        # By linearised equations tilt and cone seemed likelier; after the fit they are not.
        (["tilt and cone"], 1.0, ["tilt", "tilt and pattern", "tilt and cone", "nothing"]),
        (["tilt and cone"], -20.0, ["tilt and pattern", "tilt", "tilt and cone", "nothing"]),
        # Two such sets left no round for patterns.
        (
            ["tilt and wave", "tilt and cone"],
            -20.0,
            ["tilt and pattern", "tilt", "tilt and cone", "tilt and wave", "nothing"],
        ),
    ],
)
def test_patterns_are_weighed_once_beside_each_likeliest_set_even_where_a_likelier_set_loses(
    monkeypatch: pytest.MonkeyPatch, likelier: list[str], with_pattern: float, ranked_as: list[str]
) -> None:
    asked: Counter[str] = Counter()
    deviance = {"nothing": 50.0, "tilt": 0.0, "tilt and cone": 3.0, "tilt and wave": 4.0}
    deviance["tilt and pattern"] = with_pattern
    sets = [SimpleNamespace(terms=(), name=n) for n in likelier]

    def near(*_: Any) -> tuple[float, None]:
        asked["near"] += 1
        return 1e-9, None

    def with_patterns(run: None, best: Any, *_: Any) -> Any:
        asked[f"patterns beside {best.fit.name}"] += 1
        return None if best.fit.name != "tilt" else SimpleNamespace(terms=(), name="tilt and pattern")

    def ranked(run: None, judged: list[Any], formula: Any) -> tuple[tuple[Any, ...], list[bool]]:
        return tuple(sorted(judged, key=lambda j: j.deviance)), [True] * len(judged)

    stand_ins = {
        "regimes_of": lambda run: (), "evidence": lambda *_: (None,), "believed": lambda *_: 1.0,
        "empirical": lambda *_: None, "_of": lambda *_: None, "_beforehand": lambda *_: 0.0,
        "_distinct": lambda fits: [f for f in fits if f is not None], "_ranked": ranked, "_near": near,
        "judged_of": lambda run, found, *_: hypothesis(found.name, deviance[found.name]),
        "_unfitted": lambda *_: [], "_better": lambda *_: sets.pop() if sets else None,
        "_with_patterns": with_patterns, "replace": lambda best, **_: best,
    }  # fmt: skip
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(judging, name, stand_in)
    nothing, tilt = (SimpleNamespace(terms=(), name=n) for n in ("nothing", "tilt"))
    searched: Any = SimpleNamespace(
        run=None, nothing=nothing, found=tilt, rivals=(), inflation=1.0, scores=()
    )
    stated: Any = None
    verdicts = judging.judge(searched, {}, stated, ())
    assert [j.fit.name for j in verdicts.judged] == ranked_as
    assert asked["patterns beside tilt"] == 1
    assert asked["near"] == 1 + (ranked_as[0] != "tilt")
