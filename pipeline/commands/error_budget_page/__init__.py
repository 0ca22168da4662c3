"""The page of `pipeline.commands.error_budget`."""
