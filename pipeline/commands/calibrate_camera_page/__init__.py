"""The page of `pipeline.commands.calibrate_camera`."""
