"""Measuring on a run's wall: outlines, distances, areas, depths and diameters, each with its 1 σ."""
