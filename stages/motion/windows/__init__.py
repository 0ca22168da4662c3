"""Sliding windows: a long run is adjusted window by window, and the windows are joined as submaps."""
