"""Calibration: of the camera from boards, of the whole instrument from a gauge run."""
