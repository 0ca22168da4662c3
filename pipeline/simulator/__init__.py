"""Renders complete recordings from a scene: instrument, pipe, motion, lights, sensor; truth apart."""
