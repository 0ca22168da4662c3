"""A gauge run to camera and laser sheet: the calibration and its report."""
