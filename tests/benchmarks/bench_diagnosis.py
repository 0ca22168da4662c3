"""Counts of the diagnosis on drawn gauge runs at ring level; an interrupted benchmark can be continued.

``python -m tests.benchmarks.bench_diagnosis run RESULTS.jsonl --mode nulls --first 0 --count 300`` appends
one line a case and skips cases that have a line; modes are those of `ring_level_cases`.

``python -m tests.benchmarks.bench_diagnosis summary RESULTS.jsonl... [--proof PROOF.json]...`` prints the
table of figures, those of rendered recordings (``boresight prove``) beside those of ring level. With
``--spoil-answers`` each case is scored by the answer to another case, and all figures must get bad.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from pipeline.drill.answer import Answer, Concealed
from pipeline.drill.score import Trial, figures, shuffled
from pipeline.errors import BoresightError, UnusableError
from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CourseKind
from pipeline.simulator.effects.switch import Switch
from stages.diagnose.as_json import to_json
from stages.diagnose.channels import TRAVEL_EFFECTS, Seen, gauge_travel
from stages.diagnose.combine.compose import composed
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import Coursed, with_courses
from stages.diagnose.effects.library import LIBRARY, without
from stages.diagnose.gauge.examine import OF_A_PIPE, Examined, examine
from stages.diagnose.gauge.scan import scan
from stages.diagnose.inference import stated_belief
from stages.diagnose.travel.evidence import TravelEvidence
from tests.benchmarks.identifiable import ideal_chances
from tests.benchmarks.ring_level import ring_level_run
from tests.benchmarks.ring_level_cases import Drawn, Mode, drawn
from tests.benchmarks.ring_level_figures import more_figures

_KEPT = ("verdict", "global_p", "location", "effects", "class", "remainder", "fit", "feasibility")
app = typer.Typer()


def of_positions(library: Mapping[str, EffectModel]) -> dict[str, EffectModel]:
    """Return the effects that rings and fiducials can show when there is no evidence from the profile."""
    return {
        name: model
        for name, model in library.items()
        if name not in TRAVEL_EFFECTS and effect(name).family != "photometric"
    }


def diagnosed(case: Drawn, left_out: Sequence[str]) -> dict[str, Any]:
    """Return the answer as in diagnosis.json, and the SNR for an oracle that knows the effect's name."""
    simulated = ring_level_run(case.scene, case.file, case.switches, case.noise)
    stated = simulated.truth.stated
    geometry, travel = None, None
    try:
        geometry = examine(simulated.measured, of_positions(without(left_out)), stated)
        state = geometry.searched.found.state
        travel = gauge_travel(simulated.recording, simulated.measured, state, left_out)
        missing: tuple[str, ...] = ()
    except UnusableError as error:
        missing = (str(error),)
    seen = Seen(simulated.recording.name, geometry, travel, None, missing)
    found = to_json(composed(None, seen, stated, left_out))
    answer = {k: found[k] for k in _KEPT if k in found}
    answer["candidates"] = [c for c in found["candidates"] if c["probability"] > 1e-3]  # type: ignore[attr-defined]
    answer["shortcomings"] = list(missing)
    if left_out and geometry is not None:
        # The oracle knows the name and fits only its effect.
        travel = gauge_travel(simulated.recording, simulated.measured, geometry.searched.found.state)
    told = {"answer": answer, "snr": [oracle_snr(s, geometry, travel, stated) for s in case.switches]}
    if geometry is None:
        return told | {"expected": None}
    if len(case.switches) > 1 and not left_out:
        straight = {n: m for n, m in of_positions(LIBRARY).items() if n not in OF_A_PIPE}
        told["ideal"] = ideal_chances(case.switches, geometry.searched, straight, stated_belief(stated))
    return told | {"expected": geometry.expected}


def oracle_snr(
    switch: Switch, geometry: Examined | None, travel: TravelEvidence | None, stated: Probe
) -> float | None:
    """Return the true size over the 1 σ of one who knows the effect's name; None where it was not scored.

    This 1 σ is that of the score about the stated instrument, with poses and stated uncertainties free.
    """
    name, size = switch.name, abs(switch.values[0])
    estimate = travel.estimate(name) if travel is not None else None
    if estimate is not None:
        return float(size / np.hypot(estimate.sigma, estimate.stated_sigma))
    events = {"probe_vibration": travel.lines, "encoder_slip": travel.slips} if travel is not None else {}
    if events.get(name):
        return float(size / min(e.sigma_mm for e in events[name]))
    if geometry is None or name not in of_positions(LIBRARY):
        return None
    searched = geometry.searched
    library = {name: LIBRARY[name]}
    if switch.course.kind is not CourseKind.CONSTANT:
        coursed = with_courses(library, (switch.course.kind,))
        order = switch.quantities.get("order")
        library = {n: m for n, m in coursed.items() if isinstance(m, Coursed) and m.own in ((), (order,))}
    for s in scan(searched.run, searched.nothing, library, stated_belief(stated)):
        found = abs(s.model.quantities(s.shape, s.score.amplitude)[switch.effect.quantities[0].name])
        return float(np.sqrt(s.score.statistic) * size / max(found, 1e-12))
    return None


def _line(mode: Mode, seed: int, version: str) -> dict[str, Any]:
    case = drawn(mode, seed)
    left_out = tuple(s.name for s in case.switches) if mode is Mode.LEFTOUT else ()
    start = time.process_time()
    try:
        told = diagnosed(case, left_out)
    except BoresightError as error:
        nothing = {"verdict": "not_identifiable", "effects": [], "class": []}
        told = {"answer": nothing, "snr": [], "failed": str(error)}
    return {
        "mode": mode.value, "seed": seed, "version": version, "scene": case.scene.summary,
        "concealed": [s.truth for s in case.switches], "left_out": list(left_out),
        "cpu_s": round(time.process_time() - start, 1), **told,
    }  # fmt: skip


@app.command()
def run(
    results: Path,
    mode: Annotated[Mode, typer.Option()] = Mode.NULLS,
    first: Annotated[int, typer.Option(help="first seed")] = 0,
    count: Annotated[int, typer.Option()] = 1,
    seconds: Annotated[float, typer.Option(help="begin no case after so long")] = 1e9,
    version: Annotated[str, typer.Option(help="of the code; else as git describes it")] = "",
) -> None:
    """Diagnose drawn cases and append a line for each; cases that have a line are skipped."""
    done = {(r["mode"], r["seed"]) for r in _lines([results])} if results.exists() else set()
    version = version or _described()
    end = time.monotonic() + seconds
    for seed in range(first, first + count):
        if (mode.value, seed) in done:
            continue
        if time.monotonic() > end:
            break
        line = _line(mode, seed, version)
        with results.open("a", encoding="utf-8") as out:
            out.write(json.dumps(line) + "\n")
        _tell(line)


def _described() -> str:
    return subprocess.check_output(["git", "describe", "--always", "--dirty"], text=True).strip()


def _tell(line: dict[str, Any]) -> None:
    answer = line["answer"]
    said = ", ".join(f"{e['name']} {e['probability']:.3f}" for e in answer["effects"]) or ", ".join(
        answer["class"]
    )
    told = " ".join(f"{n} {v[0]:.4g} {''.join(map(str, c))}" for n, v, *c in line["concealed"]) or "nothing"
    typer.echo(
        f"{line['mode']} {line['seed']}: {told} (snr {line['snr']}) -> {answer['verdict']} {said} "
        f"p {answer.get('global_p') or 0:.2g} {line['cpu_s']} s {line.get('failed', '')}"
    )


def trial_from(line: dict[str, Any]) -> Trial:
    """Return the trial of one line of results."""
    concealed = tuple(Concealed(name=n, values=tuple(map(float, v))) for n, v, *_ in line["concealed"])
    seen = [s for s in line["snr"] if s is not None]
    snr = min(seen) if seen and len(seen) == len(concealed) else None
    name = f"{line['mode']}-{line['seed']}"
    return Trial(name, concealed, Answer.model_validate(line["answer"]), tuple(line["left_out"]), snr)


@app.command()
def summary(
    results: list[Path],
    proof: Annotated[list[Path] | None, typer.Option(help="proof.json of rendered recordings")] = None,
    spoil_answers: Annotated[bool, typer.Option(help="score each case by another case's answer")] = False,
) -> None:
    """Print the table of figures with 95 % intervals."""
    lines = list(_lines(results))
    if spoil_answers:
        true = [trial_from(line) for line in lines]
        whose = {id(t.answer): line["answer"] for t, line in zip(true, lines, strict=True)}
        lines = [n | {"answer": whose[id(t.answer)]} for n, t in zip(lines, shuffled(true), strict=True)]
    trials = [trial_from(line) for line in lines]
    for row in figures(trials):
        typer.echo(f"ring level | {row.text}")
    for file in proof or ():
        for rate in json.loads(file.read_text("utf-8"))["figures"]:
            typer.echo(f"rendered   | {rate['text']}")
    for text in more_figures(lines, trials):
        typer.echo(text)
    typer.echo(f"versions: {', '.join(sorted({line['version'] for line in lines}))}")


def _lines(files: list[Path]) -> Iterator[dict[str, Any]]:
    for file in files:
        for text in file.read_text("utf-8").splitlines():
            yield json.loads(text)


if __name__ == "__main__":
    app()
