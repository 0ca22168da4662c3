"""Hostile bytes for every parser: ``python -m tests.fuzz`` searches, the corpus is replayed by the tests."""
