"""Drill: diagnoses of recordings with concealed effects, held against what was concealed."""
