"""Tracking: texture landmarks on the wall, followed from frame to frame in unrolled strips."""
