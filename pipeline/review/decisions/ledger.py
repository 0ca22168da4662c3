"""The ledger of a review: every action and signature in order, in an SQLite file that survives a crash."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from pipeline.errors import BoresightError, InputError
from pipeline.files.disk import disk_errors_named
from pipeline.review.decisions import Action, action_of

# Time that an action waits for another process that is writing, before it is refused. Chosen.
_BUSY_S = 10.0
_KEPT = "free space or correct its permissions, then repeat the last step; earlier decisions are kept"
# Errors of the disk, in any variant; any other error is one of the file's content.
_PRIMARY = 0xFF
_DISK_REFUSALS = (
    sqlite3.SQLITE_FULL, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_PERM,
)  # fmt: skip
_SIGNED = "name, standard, remarks, at, revision, sha256"


class StaleError(BoresightError):
    """An action was meant for a state that another tab or person has changed since."""


@dataclass(frozen=True)
class Entry:
    """One action: its number, the findings on which it was taken, author, time (ISO 8601, UTC), content."""

    id: int
    basis: str
    who: str
    at: str
    action: Action


@dataclass(frozen=True)
class Signature:
    """A sign-off of the state after action ``revision``; ``sha256`` is over inputs and decisions."""

    id: int
    name: str
    standard: str
    remarks: str
    at: str
    revision: int
    sha256: str


@dataclass(frozen=True)
class Ledger:
    """Decisions in the SQLite file ``file``; every call opens it, so that threads need not share it."""

    file: Path

    def prepare(self) -> None:
        """Create the file or convert it to the newest format.

        Raises
        ------
        InputError
            When it is not a ledger, or one of a newer program.
        """
        with disk_errors_named(self.file.parent, _KEPT):
            self.file.parent.mkdir(exist_ok=True)
        with self._open() as connection:
            _migrate(connection, self.file)

    def keep_basis(self, sha256: str, defects: str) -> None:
        """Store the findings on which decisions will be taken."""
        with self._open() as connection:
            connection.execute("INSERT OR IGNORE INTO basis VALUES (?, ?, ?)", (sha256, defects, _now()))

    def basis(self, sha256: str) -> str:
        """Return stored findings, the text of a defects.json."""
        with self._open() as connection:
            found = connection.execute("SELECT defects FROM basis WHERE sha256 = ?", (sha256,)).fetchone()
        if found is None:
            raise InputError(self.file, f"has no findings {sha256[:12]}", hint="restore it from a copy")
        return str(found[0])

    def append(self, action: Action, who: str, basis: str, revision: int) -> Entry:
        """Append an action taken at a ``revision``, the number of the last action its author saw.

        Raises
        ------
        StaleError
            When there are later ones.
        """
        with self._open() as connection:
            connection.execute("BEGIN IMMEDIATE")
            last = _revision(connection)
            if last > revision:
                raise StaleError(f"{last - revision} changes have been made elsewhere since; look again")
            if last < revision:
                raise StaleError("the record of decisions is older than the shown state; look again")
            at = _now()
            row = (basis, who, at, action.model_dump_json())
            written = connection.execute(
                "INSERT INTO action (basis, who, at, document) VALUES (?, ?, ?, ?)", row
            )
            connection.commit()
        return Entry(int(written.lastrowid or 0), basis, who, at, action)

    def entries(self) -> tuple[Entry, ...]:
        """Return all actions in order."""
        with self._open() as connection:
            rows = connection.execute(
                "SELECT id, basis, who, at, document FROM action ORDER BY id"
            ).fetchall()
        return tuple(Entry(i, basis, who, at, action_of(text)) for i, basis, who, at, text in rows)

    def revision(self) -> int:
        """Return the number of the last action, 0 before the first."""
        with self._open() as connection:
            return _revision(connection)

    def sign(self, name: str, standard: str, remarks: str, revision: int, sha256: str) -> Signature:
        """Append a signature of the state at ``revision``.

        Raises
        ------
        StaleError
            When the state has changed since.
        """
        with self._open() as connection:
            connection.execute("BEGIN IMMEDIATE")
            if _revision(connection) != revision:
                raise StaleError("the findings have been changed elsewhere since; look again before signing")
            row = (name, standard, remarks, _now(), revision, sha256)
            written = connection.execute(f"INSERT INTO signature ({_SIGNED}) VALUES (?, ?, ?, ?, ?, ?)", row)
            connection.commit()
        return Signature(int(written.lastrowid or 0), *row)

    def signatures(self) -> tuple[Signature, ...]:
        """Return all signatures in order."""
        with self._open() as connection:
            rows = connection.execute(f"SELECT id, {_SIGNED} FROM signature ORDER BY id").fetchall()
        return tuple(Signature(*row) for row in rows)

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        connection = sqlite3.connect(self.file, timeout=_BUSY_S, isolation_level=None)
        try:
            connection.execute("PRAGMA foreign_keys = ON")
            connection.execute("PRAGMA synchronous = FULL")
            yield connection
        except sqlite3.DatabaseError as error:
            if error.sqlite_errorcode & _PRIMARY in _DISK_REFUSALS:
                raise InputError(
                    self.file, f"cannot be written: {error}",
                    expected="a folder that can be written, on a disk with room", hint=_KEPT,
                ) from error  # fmt: skip
            hint = "move it away to start again, or restore it from a copy"
            raise InputError(self.file, f"cannot be used as a ledger: {error}", hint=hint) from error
        finally:
            connection.close()


def _migrate(connection: sqlite3.Connection, file: Path) -> None:
    """Apply the numbered scripts that are new for the file, each atomically."""
    scripts = sorted(p.name for p in _scripts().iterdir() if p.name.endswith(".sql"))
    connection.execute("BEGIN EXCLUSIVE")
    version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    if version > len(scripts):
        connection.execute("ROLLBACK")
        raise InputError(file, "was written by a newer boresight", hint="use that version")
    for number, name in enumerate(scripts[version:], version + 1):
        for statement in _statements(_scripts().joinpath(name).read_text("utf-8")):
            connection.execute(statement)
        connection.execute(f"PRAGMA user_version = {number}")
    connection.execute("COMMIT")


def _scripts() -> Traversable:
    return files("pipeline.review.decisions").joinpath("migrations")


def _statements(script: str) -> list[str]:
    return [s for s in (part.strip() for part in script.split(";")) if s]


def _revision(connection: sqlite3.Connection) -> int:
    return int(connection.execute("SELECT coalesce(max(id), 0) FROM action").fetchone()[0])


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
