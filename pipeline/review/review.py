"""The review of a run: its current findings and signature; decisions are transferred to new findings."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pipeline.artefacts.measured import Wall
from pipeline.artefacts.wall_map import WallMap
from pipeline.files.codec import Json, canonical
from pipeline.files.disk import FileStamp, stamp_of
from pipeline.review import decisions as do
from pipeline.review.decisions import Action
from pipeline.review.decisions.ledger import Entry, Ledger, Signature
from pipeline.review.decisions.replay import Finding, ImpossibleError, counting, replay
from pipeline.review.measuring import OutlineGauge
from pipeline.review.run_files import RunFiles, measured_findings

FOLDER = "review"
# A new finding is the same as an old one when their middles are no farther apart than this, or than half its
# length.
_APART_MM = 5.0


@dataclass(frozen=True)
class State:
    """The current state of a review.

    Attributes
    ----------
    revision : int
        Number of the last action.
    findings : tuple of Finding
    may_undo, may_redo : bool
    lost : tuple of Entry
        Decisions whose finding no longer exists after a later computation of the run.
    assumed : Assume
        Wall thickness and yield strength, for wall loss and failure pressure.
    described : Describe
        Facts of the inspection from the recording, completed by the inspector.
    entries : tuple of Entry
        Entries that count, in order.
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
        """Return what is known of the inspection: the inspector's last entries, else the recording's."""
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


def same_findings(old: Iterable[Finding], new: Iterable[Finding]) -> dict[str, str]:
    """Return which new finding each old one is: the nearest of its kind within `_reach_mm`, by their ids."""
    free = list(new)
    found: dict[str, str] = {}
    for finding in old:
        near = [f for f in free if f.kind == finding.kind and _apart_mm(finding, f) <= _reach_mm(finding)]
        if near:
            match = min(near, key=lambda f: _apart_mm(finding, f))
            found[finding.id] = match.id
            free.remove(match)
    return found


def carried(
    entries: Sequence[Entry], basis: str, translations: dict[str, dict[str, str]]
) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
    """Return the entries in the numbers of the findings ``basis``, and those that lost their finding.

    ``translations`` gives for each earlier basis the new number of each of its findings.
    """
    kept: list[Entry] = []
    lost: list[Entry] = []
    for entry in entries:
        names = {} if entry.basis == basis else translations[entry.basis]
        moved = entry if entry.basis == basis else _renamed(entry, names)
        (lost if moved is None else kept).append(moved or entry)
    return tuple(kept), tuple(lost)


def _renamed(entry: Entry, names: dict[str, str]) -> Entry | None:
    action = entry.action
    if isinstance(action, do.Merge):
        moved = [_translated(f, names) for f in action.findings]
        if not all(moved):
            return None
        return replace(entry, action=action.model_copy(update={"findings": tuple(moved)}))
    if isinstance(action, do.Add | do.Assume | do.Describe | do.Undo | do.Redo):
        return entry
    one = _translated(action.finding, names)
    return replace(entry, action=action.model_copy(update={"finding": one})) if one else None


def _translated(name: str, names: dict[str, str]) -> str | None:
    """Return the new number; findings made by hand keep theirs, parts follow what they were split from."""
    whole, dot, part = name.partition(".")
    if name[0] in "am":
        return name
    return names[whole] + dot + part if whole in names else None


def _middle(finding: Finding) -> tuple[float, float]:
    s, a = np.mean(np.asarray(finding.outline), axis=0)
    return float(s), float(a)


def _reach_mm(finding: Finding) -> float:
    return max(_APART_MM, finding.size.length_mm / 2)


def _apart_mm(one: Finding, other: Finding) -> float:
    """Return how far two findings' middles are apart, mm: along the pipe and around it taken together."""
    (s0, a0), (s1, a1) = _middle(one), _middle(other)
    turn = (a1 - a0 + np.pi) % (2 * np.pi) - np.pi
    span = max(np.ptp([a for _, a in one.outline]), 1e-6)
    return float(np.hypot(s1 - s0, turn / span * max(one.size.width_mm, 1e-6)))
