"""Renders complete recordings from a scene: instrument, pipe, motion, lights, sensor.

The truth is kept apart.
"""
