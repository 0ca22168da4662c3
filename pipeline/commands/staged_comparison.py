"""Two runs compared for their review; what was computed before is used again.

It stands apart from `pipeline.commands.review`, since it imports all stages, for which a review of one run
need not wait.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from pipeline.artefacts.comparison import Comparison, FindingPair, RegisteredWalls, WallPair
from pipeline.errors import InputError
from pipeline.files.codec import digest
from pipeline.machine.configuration import Configuration, resolve
from pipeline.machine.display import Display, ProgressDisplay, SilentDisplay
from pipeline.machine.outcome import Number, RunOutcome
from pipeline.machine.plan import Plan, Selection, Source, make_plan
from pipeline.machine.run_folder import claimed, logged
from pipeline.machine.runner import Runner
from pipeline.review.compared import RunPair
from pipeline.review.review import FOLDER
from pipeline.system.parallel import stop_wish
from stages.catalogue import PIPELINE
from stages.compare import COMPARISON


@dataclass(frozen=True)
class StagedComparison:
    """Compares two runs with the parameters of a configuration; what was computed before is reused."""

    configuration: Configuration
    _turn: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    @classmethod
    def configured(cls, config: Path | None, assignments: Sequence[str]) -> StagedComparison:
        """Return a comparison with the parameters of a file, which may be a whole run's, and assignments."""
        return cls(resolve((*PIPELINE, *COMPARISON), config, assignments))

    def __call__(self, pair: RunPair) -> tuple[RegisteredWalls, Comparison]:
        """Return the comparison of a pair as it stands; a server's threads take turns.

        Raises
        ------
        UnusableError
            When the two do not show the same wall.
        """
        return self._compared(pair, SilentDisplay())

    def complete(self, pair: RunPair) -> None:
        """Compute what is missing, with a bar for the user; Ctrl-C stops it. Raises as a call does."""
        with ProgressDisplay(Console(stderr=True)) as display:
            self._compared(pair, display)

    def _compared(self, pair: RunPair, display: Display) -> tuple[RegisteredWalls, Comparison]:
        plan = self._plan(pair)
        place = pair.now.files.path / FOLDER / "comparison"
        with self._turn, claimed(place) as folder, logged(folder) as logger, stop_wish() as wish:
            workers = len(os.sched_getaffinity(0))
            Runner(plan, (), folder, _not_recorded, _no_headline, display, logger, wish, workers).run(
                Selection()
            )
            store, (first, second) = folder.store, plan.steps
            walls = store.look(first.stage.name, first.key, RegisteredWalls)
            found = store.look(second.stage.name, second.key, Comparison)
        if walls is None or found is None:
            raise InputError(place, "lost a result of the comparison", hint="start the review again")
        return walls, found

    def _plan(self, pair: RunPair) -> Plan:
        findings = pair.findings()
        found = pair.walls()
        walls = Source(WallPair, found, pair.walls_key(found))
        return make_plan(
            COMPARISON, self.configuration, (walls, Source(FindingPair, findings, digest(findings)))
        )


def _no_headline(artefacts: Mapping[type, object]) -> tuple[Number, ...]:
    """Name no number before others: the page shows the whole comparison."""
    return ()


def _not_recorded(outcome: RunOutcome) -> None:
    """Leave no record: the store's manifests say which results are whole."""
