"""One thin command each; `pipeline.cli` attaches them by name."""
