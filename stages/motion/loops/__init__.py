"""Loop closure: walls that the probe passes again are registered, and the drift they show is corrected."""
