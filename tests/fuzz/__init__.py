"""Malformed bytes for every parser: ``python -m tests.fuzz`` searches, and the tests repeat the corpus."""
