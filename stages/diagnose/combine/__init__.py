"""Combine what all channels of both recordings show into one answer."""
