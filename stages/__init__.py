"""The verbs of boresight: one module or package for each step from frames to report."""
