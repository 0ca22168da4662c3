"""A recording that is still being written: watched until it rests, shown meanwhile on a live page."""
