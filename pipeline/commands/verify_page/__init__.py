"""The page of `pipeline.commands.verify`."""
