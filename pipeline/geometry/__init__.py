"""Rigid motions, and pipe coordinates about a straight or curved axis."""
