"""Rigid motion, pipe coordinates and robust fits."""
