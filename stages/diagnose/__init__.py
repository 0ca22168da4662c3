"""Diagnosis: find, name, size and confirm physics that the model of the instrument leaves out."""
