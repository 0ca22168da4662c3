"""The page of `pipeline.commands.prove`."""
