"""The page of `pipeline.commands.calibrate`."""
