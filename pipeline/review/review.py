"""The review of a run: findings as they stand, what may be done with them, and whether it is signed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache

from pipeline.artefacts.measured import Wall
from pipeline.artefacts.wall_map import WallMap
from pipeline.files.codec import Json, canonical
from pipeline.files.disk import FileStamp, stamp_of
from pipeline.review.decisions import actions as do
from pipeline.review.decisions.actions import Action
from pipeline.review.decisions.carry import carried, same_findings
from pipeline.review.decisions.ledger import Entry, Ledger, Signature
from pipeline.review.decisions.replay import Finding, ImpossibleError, counting, replay
from pipeline.review.measuring import OutlineGauge
from pipeline.review.run_files import RunFiles, measured_findings

FOLDER = "review"


@dataclass(frozen=True)
class State:
    """A review as it stands.

    Attributes
    ----------
    revision : int
        Number of the last action.
    findings : tuple of Finding
    may_undo, may_redo : bool
    lost : tuple of Entry
        Decisions whose finding a later computation of the run no longer has.
    assumed : Assume
        Wall thickness and yield strength, for wall loss and failure pressure.
    described : Describe
        For whom, where and how it was inspected, as the recording says and the inspector completed it.
    entries : tuple of Entry
        Those that count, in order.
    """

    revision: int
    findings: tuple[Finding, ...]
    may_undo: bool
    may_redo: bool
    lost: tuple[Entry, ...]
    assumed: do.Assume
    entries: tuple[Entry, ...]
    described: do.Describe


@dataclass(frozen=True)
class Seal:
    """What a signature of a state binds, and the last signature that was given.

    Attributes
    ----------
    revision : int
    sha256 : str
        Over the run's files and the decisions that count.
    signature : Signature or None
    """

    revision: int
    sha256: str
    signature: Signature | None

    @property
    def signed(self) -> bool:
        """Whether the last signature is of just this state."""
        return self.signature is not None and self.signature.sha256 == self.sha256


@dataclass(frozen=True)
class Review:
    """A run and the ledger of decisions on it."""

    files: RunFiles

    @property
    def ledger(self) -> Ledger:
        """Where decisions are kept, inside the run folder."""
        return Ledger(self.files.path / FOLDER / "decisions.sqlite")

    def state(self) -> State:
        """Return the review as it stands.

        Raises
        ------
        InputError
            When the run or the ledger cannot be read.
        """
        basis, findings = self._basis()
        every = self.ledger.entries()
        known, lost = carried(every, basis, self._translations(every, basis, findings))
        done, undone = counting(known)
        assumed = [e.action for e in done if isinstance(e.action, do.Assume)]
        return State(
            revision=every[-1].id if every else 0,
            findings=replay(findings, known, OutlineGauge(self.wall())),
            may_undo=bool(done),
            may_redo=bool(undone),
            lost=lost,
            assumed=assumed[-1] if assumed else do.Assume(),
            entries=done,
            described=self._described(done),
        )

    def _described(self, done: tuple[Entry, ...]) -> do.Describe:
        """Return what the recording says of the inspection, with what the inspector said last over it."""
        said = [e.action for e in done if isinstance(e.action, do.Describe)]
        own = {name: text for name, text in said[-1].model_dump().items() if text} if said else {}
        return do.Describe(**(self.files.record()["recording"].get("inspection", {}) | own))

    def seal(self, state: State) -> Seal:
        """Return what a signature of a state binds; reads every file of the run once."""
        signatures = self.ledger.signatures()
        return Seal(state.revision, self._sha256(state.entries), signatures[-1] if signatures else None)

    def act(self, action: Action, who: str, revision: int) -> State:
        """Take an action and return the state after it.

        Raises
        ------
        StaleError
            When the author had not seen the last action.
        ImpossibleError
            When the action does not fit the findings.
        """
        if isinstance(action, do.Reject) and not action.reason.strip():
            raise ImpossibleError("a rejection needs a reason")
        basis, findings = self._basis()
        known, _ = carried(
            self.ledger.entries(), basis, self._translations(self.ledger.entries(), basis, findings)
        )
        trial = Entry(revision + 1, basis, who, "", action)
        replay(findings, (*known, trial), OutlineGauge(self.wall()))
        self.ledger.keep_basis(basis, self.files.defects_text())
        self.ledger.append(action, who, basis, revision)
        return self.state()

    def sign(self, name: str, standard: str, remarks: str, revision: int) -> State:
        """Sign the state at a revision.

        Raises
        ------
        StaleError
            When it has changed since.
        """
        self.ledger.sign(name, standard, remarks, revision, self.seal(self.state()).sha256)
        return self.state()

    def wall(self) -> WallMap:
        """Return the wall as the run measured it."""
        return self.files.artefact(Wall).radius_map

    def _basis(self) -> tuple[str, tuple[Finding, ...]]:
        """Return the hash of the findings as measured now, and the findings."""
        file = self.files.file("defects.json")
        return _measured(self.files, stamp_of(file) if file.exists() else None)

    def _translations(
        self, entries: tuple[Entry, ...], basis: str, findings: tuple[Finding, ...]
    ) -> dict[str, dict[str, str]]:
        earlier = {e.basis for e in entries} - {basis}
        file = self.ledger.file
        return {b: same_findings(measured_findings(self.ledger.basis(b), file), findings) for b in earlier}

    def _sha256(self, entries: tuple[Entry, ...]) -> str:
        decided: list[Json] = [[e.who, e.at, e.action.model_dump_json()] for e in entries]
        bound: Json = dict(self.files.fingerprint())
        return hashlib.sha256(canonical([bound, decided])).hexdigest()


@lru_cache(maxsize=4)
def _measured(files: RunFiles, _as_it_is: FileStamp | None) -> tuple[str, tuple[Finding, ...]]:
    text = files.defects_text()
    found = measured_findings(text, files.path / "defects.json")
    return hashlib.sha256(text.encode()).hexdigest(), found


def open_review(files: RunFiles) -> Review:
    """Open the review of a completed run, its ledger made or brought up to date.

    Raises
    ------
    InputError
        When the run is not completed or a file of it cannot be read.
    """
    files.record()
    review = Review(files)
    review.ledger.prepare()
    review.state()
    return review
