"""Runs a plan: reuses complete results, computes missing ones, and records the outcome in any case."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace

import numpy as np

from pipeline.errors import BoresightError, Cancelled, InputError
from pipeline.files.provenance import MadeBy
from pipeline.machine.display import Display
from pipeline.machine.outcome import WARNING, Number, Results, RunOutcome, StageOutcome, State
from pipeline.machine.plan import Plan, Selection, Step
from pipeline.machine.run_folder import Exporter, RunFolder, Writer, published_key, withdraw
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Context, plain
from pipeline.machine.store import Provenance, Store, Stored
from pipeline.system.native import give_back_memory, keep_freed_memory
from pipeline.system.parallel import one_library_thread

_LONGEST_PROBLEM = 300  # characters of an unexpected error that run.json quotes; the log has all of it
_LOOK_S = 0.2  # longest wait, after which the main thread checks whether the user wishes to stop


class FailedError(BoresightError):
    """A bug: an error that no input should cause. The log holds the traceback."""


class Runner:
    """Runs one plan in one claimed run folder.

    Parameters
    ----------
    plan
        The stages, wired and keyed.
    exporters
        Writers of files for users; each runs as soon as its inputs exist.
    folder
        A claimed run folder.
    record
        Called with the outcome at every change; writes run.json.
    headline
        Returns the headline numbers of artefacts by class.
    display, logger, wish, workers
        Receiver of progress, receiver of messages, the user's wish to stop, and the number of threads.
    made_by
        Provenance that exporters write into their files.
    lent
        Stores of other runs, whose results are used like own ones.
    at_once
        Largest number of stages that run at the same time.
    """

    def __init__(
        self,
        plan: Plan,
        exporters: Sequence[Exporter],
        folder: RunFolder,
        record: Callable[[RunOutcome], None],
        headline: Callable[[Mapping[type, object]], tuple[Number, ...]],
        display: Display,
        logger: logging.Logger,
        wish: threading.Event,
        workers: int = 2,
        made_by: MadeBy | None = None,
        lent: Sequence[Store] = (),
        at_once: int = 2,
    ) -> None:
        self._plan, self._exporters, self._folder = plan, exporters, folder
        self._record, self._headline = record, headline
        self._display, self._logger, self._wish, self._workers = display, logger, wish, workers
        self._lent, self._at_once = lent, at_once
        self._keys = plan.keys() | {Results: plan.key(), MadeBy: made_by.key if made_by is not None else ""}
        known = (e for e in exporters if all(k in self._keys for k in e.inputs().values()))
        self._export_keys = {e: e.key(self._keys) for e in known}
        self._outcomes = {
            s.stage.label: StageOutcome(s.stage.label, s.stage.version, s.key) for s in plan.steps
        }
        self._artefacts: dict[type, object] = {s.kind: s.value for s in plan.sources} | {MadeBy: made_by}
        self._metrics: tuple[Number, ...] = ()
        self._writer = Writer(folder, logger)
        self._over = threading.Event()
        self._at = ""

    @one_library_thread()
    def run(self, selection: Selection) -> RunOutcome:
        """Run the stages selected.

        Raises
        ------
        UnusableError, InputError, Cancelled
            As a stage raised it; completed results are kept.
        FailedError
            For anything else that a stage or exporter raised; the traceback is in the log.
        """
        selection.check(self._plan)
        keep_freed_memory()
        self._display.planned(1 if selection.only else len(self._plan.steps))
        try:
            with self._writer:
                self._withdraw_stale()
                self._note(State.RUNNING)
                self._complete_all(selection)
                self._publish_results(selection)
            return self._note(State.COMPLETED)
        except BoresightError as error:
            self._end(State.after(error), str(error))
            raise
        except Exception as error:
            self._at = self._writer.failed or self._at
            self._logger.exception("%s failed", self._at)
            problem = f"{type(error).__name__}: {str(error)[:_LONGEST_PROBLEM]}"
            self._end(State.FAILED, problem)
            raise FailedError(
                f"{self._at} failed: {problem}\n"
                f"This is an error in the program. The log with the details: {self._folder.log}"
            ) from error
        finally:
            give_back_memory()

    def _complete_all(self, selection: Selection) -> None:
        """Complete every step as soon as its inputs exist; some run at the same time."""
        waiting = list(self._plan.steps)
        running: dict[Future[Stored], Step] = {}
        with ThreadPoolExecutor(self._at_once, "stage") as pool:
            try:
                while waiting or running:
                    step = _next(waiting, running.values(), self._at_once)
                    if step is None:
                        self._await(running)
                    elif self._is_due(step, selection):
                        running[pool.submit(self._compute, step)] = step
            finally:
                self._over.set()

    def _is_due(self, step: Step, selection: Selection) -> bool:
        """Return whether a step has to be computed, and announce it; settle it if its result exists."""
        name = step.stage.label
        self._at = f"stage {name}"
        self._stop_if_wished()
        if not selection.recomputes(step, self._plan):
            stored = self._stored(step)
            if stored is not None:
                self._settle(step, stored, State.REUSED)
            if stored is not None or selection.skips(step):
                return False
        self._check_inputs(step)
        self._outcomes[name] = replace(self._outcomes[name], state=State.RUNNING)
        self._note(State.RUNNING)
        self._display.started(name)
        self._logger.info("stage %s starts, key %s", name, step.key)
        return True

    def _stored(self, step: Step) -> Stored | None:
        """Return the result of a step from the own store, or from a lent one."""
        name, kind = step.stage.name, plain(step.output)
        own = self._folder.store.read(name, step.key, kind)
        lent = (store.borrow(name, step.key, kind) for store in self._lent)
        return own if own is not None else next((s for s in lent if s is not None), None)

    def _await(self, running: dict[Future[Stored], Step]) -> None:
        """Settle the steps that have ended, or wait a moment for one to end."""
        ended = wait(running, _LOOK_S, FIRST_COMPLETED).done
        for future in [f for f in running if f in ended]:
            step = running.pop(future)
            self._at = f"stage {step.stage.label}"
            self._settle(step, future.result(), State.COMPLETED)

    def _compute(self, step: Step) -> Stored:
        """Compute a step and return the result as read back from the store; called on its own thread."""
        name = step.stage.name
        numbers: list[Number] = []
        start = time.monotonic()
        artefact = self._artefact(step, numbers)
        kind = type(artefact).__name__
        provenance = Provenance(
            name, step.stage.version, step.key, round(time.monotonic() - start, 3), tuple(numbers)
        )
        self._folder.store.write(artefact, provenance)
        del artefact
        stored = self._folder.store.read(name, step.key, plain(step.output))
        if stored is None:
            raise TypeError(f"stage {name} made a {kind} that cannot be read back")
        return stored

    def _artefact(self, step: Step, numbers: list[Number]) -> object:
        """Call a stage. If an input changed meanwhile, that is raised instead of any other error."""
        inputs: dict[str, object] = dict.fromkeys(step.stage.may_lack())
        inputs |= {argument: self._artefacts[kind] for argument, kind in step.inputs}
        context = self._context(step, numbers)
        try:
            return step.stage.function(**inputs, parameters=step.parameters, context=context)
        finally:
            for source in self._plan.sources:
                source.refuse_changed()

    def _context(self, step: Step, numbers: list[Number]) -> Context:
        def progress(done: int, total: int) -> None:
            self._stop_if_wished()
            self._display.progressed(step.stage.label, done, total)

        def report(name: str, value: float | int | str, unit: str = "") -> None:
            self._logger.info("%s: %s = %s %s", step.stage.label, name, value, unit)
            numbers.append(Number(name, value, unit))

        def warn(text: str) -> None:
            self._logger.warning("%s: %s", step.stage.name, text)
            numbers.append(Number(WARNING, text))

        random = np.random.default_rng(step.seed)
        scratch = Scratch(self._folder.internal)
        return Context(progress, report, random, self._workers, scratch, warn)

    def _stop_if_wished(self) -> None:
        if self._wish.is_set():
            raise Cancelled("stopped; the same command continues from here")
        if self._over.is_set():
            raise Cancelled("stopped with the others")

    def _check_inputs(self, step: Step) -> None:
        for _, kind in step.inputs:
            maker = self._plan.maker(kind)
            if kind not in self._artefacts and maker is not None:
                raise InputError(
                    self._folder.path,
                    f"holds no result of stage {maker.stage.label}, which {step.stage.label} needs",
                    hint="run without --only, or that stage first",
                )

    def _settle(self, step: Step, stored: Stored, state: State) -> None:
        name, made = step.stage.label, stored.provenance
        self._artefacts[step.output] = stored.artefact
        self._metrics += self._headline({step.output: stored.artefact})
        outcome = replace(self._outcomes[name], state=state, seconds=made.seconds, numbers=made.numbers)
        self._outcomes[name] = outcome
        self._logger.info("stage %s %s, %.1f s", name, state.value, outcome.seconds)
        self._display.ended(outcome)
        self._note(State.RUNNING)
        self._publish_ready()

    def _publish_ready(self) -> None:
        try:
            self._writer.check()
        finally:
            self._at = self._writer.failed or self._at
        for exporter, key in self._export_keys.items():
            if all(k in self._artefacts for k in exporter.inputs().values()):
                self._writer.offer(exporter, key, self._artefacts)

    def _withdraw_stale(self) -> None:
        for exporter in self._exporters:
            key = self._export_keys.get(exporter)
            if key is None or published_key(exporter, self._folder) != key:
                withdraw(exporter, self._folder)

    def _publish_results(self, selection: Selection) -> None:
        if not selection.only:
            outcome = self._outcome(State.COMPLETED, "")
            self._artefacts[Results] = Results(outcome, tuple(self._artefacts.values()))
            self._publish_ready()

    def _end(self, state: State, problem: str) -> None:
        """Record the outcome of an incomplete run; on a full disk this may fail, too."""
        self._logger.info("ended: %s: %s", state.value, problem)
        for name, outcome in self._outcomes.items():
            if outcome.state == State.RUNNING:
                own = name == self._at.removeprefix("stage ")
                how, why = (state, problem) if own else (State.CANCELLED, f"stopped with {self._at}")
                self._outcomes[name] = replace(outcome, state=how, problem=why)
                self._display.ended(self._outcomes[name])
        try:
            self._note(state, problem)
        except InputError as error:
            self._logger.warning("run.json could not be written: %s", error)

    def _note(self, state: State, problem: str = "") -> RunOutcome:
        outcome = self._outcome(state, problem)
        self._record(outcome)
        return outcome

    def _outcome(self, state: State, problem: str) -> RunOutcome:
        return RunOutcome(state, tuple(self._outcomes.values()), self._metrics, problem)


def _next(waiting: list[Step], running: Collection[Step], at_once: int) -> Step | None:
    """Remove the first step with complete inputs from the list; None while too many steps are running."""
    missing = {s.output for s in (*waiting, *running)}
    ready = (s for s in waiting if not any(kind in missing for _, kind in s.inputs))
    step = next(ready, None) if len(running) < at_once else None
    if step is not None:
        waiting.remove(step)
    return step
