"""The review of a run: findings as they stand, what may be done with them, and whether it is signed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache

from pipeline.codec import Json, canonical
from pipeline.review.decisions import actions as do
from pipeline.review.decisions.actions import Action
from pipeline.review.decisions.carry import carried, same_findings
from pipeline.review.decisions.ledger import Entry, Ledger, Signature
from pipeline.review.decisions.replay import Finding, counting, replay
from pipeline.review.measuring.outline import OutlineGauge
from pipeline.review.measuring.wall import MeasuredWall, read_wall
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
        Wall thickness and yield strength taken for known.
    entries : tuple of Entry
        Those that count, in order.
    sha256 : str
        Over inputs and decisions.
    signature : Signature or None
        The last one.
    """

    revision: int
    findings: tuple[Finding, ...]
    may_undo: bool
    may_redo: bool
    lost: tuple[Entry, ...]
    assumed: do.Assume
    entries: tuple[Entry, ...]
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
        signatures = self.ledger.signatures()
        assumed = [e.action for e in done if isinstance(e.action, do.Assume)]
        return State(
            revision=every[-1].id if every else 0,
            findings=replay(findings, known, OutlineGauge(self.wall())),
            may_undo=bool(done),
            may_redo=bool(undone),
            lost=lost,
            assumed=assumed[-1] if assumed else do.Assume(),
            entries=done,
            sha256=self._sha256(done),
            signature=signatures[-1] if signatures else None,
        )

    def act(self, action: Action, who: str, revision: int) -> State:
        """Take an action and return the state after it.

        Raises
        ------
        StaleError
            When the author had not seen the last action.
        ImpossibleError
            When the action does not fit the findings.
        """
        basis, findings = self._basis()
        known, _ = carried(
            self.ledger.entries(), basis, self._translations(self.ledger.entries(), basis, findings)
        )
        trial = Entry(revision + 1, basis, who, "", action)
        replay(findings, (*known, trial), OutlineGauge(self.wall()))
        self.ledger.append(action, who, basis, revision)
        return self.state()

    def sign(self, name: str, standard: str, remarks: str, revision: int) -> State:
        """Sign the state at a revision.

        Raises
        ------
        StaleError
            When it has changed since.
        """
        self.ledger.sign(name, standard, remarks, revision, self.state().sha256)
        return self.state()

    def wall(self) -> MeasuredWall:
        """Return the wall, read again when its file has changed."""
        file = self.files.path / "radius_map.npz"
        return _wall(self.files, file.stat().st_mtime_ns if file.exists() else 0)

    def _basis(self) -> tuple[str, tuple[Finding, ...]]:
        """Return the hash of the findings as measured now, kept in the ledger, and the findings."""
        text = self.files.defects_text()
        sha256 = hashlib.sha256(text.encode()).hexdigest()
        self.ledger.keep_basis(sha256, text)
        return sha256, measured_findings(text, self.files.path / "defects.json")

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
def _wall(files: RunFiles, _changed: int) -> MeasuredWall:
    return read_wall(files.path)


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
