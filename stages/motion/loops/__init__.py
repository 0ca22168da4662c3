"""Loop closure: registers wall that the probe passes again, and corrects the drift that this shows."""
