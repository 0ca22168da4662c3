-- Findings as they were when decisions were taken on them, for a run may be computed again.
CREATE TABLE basis (
    sha256 TEXT PRIMARY KEY,
    defects TEXT NOT NULL,
    seen_at TEXT NOT NULL
) STRICT;

-- Every action in order, of which nothing is ever changed or removed.
CREATE TABLE action (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    basis TEXT NOT NULL REFERENCES basis (sha256),
    who TEXT NOT NULL,
    at TEXT NOT NULL,
    document TEXT NOT NULL
) STRICT;

CREATE TABLE signature (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    name TEXT NOT NULL,
    standard TEXT NOT NULL,
    remarks TEXT NOT NULL,
    at TEXT NOT NULL,
    revision INTEGER NOT NULL,
    sha256 TEXT NOT NULL
) STRICT;
