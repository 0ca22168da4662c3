"""Calibration of camera and laser sheet together from one run through a gauge."""
