"""Two runs of one pipe laid on each other: what grew, what is new, what is gone."""
