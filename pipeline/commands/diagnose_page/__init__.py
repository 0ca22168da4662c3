"""The page of `pipeline.commands.diagnose`."""
