"""Results that stages pass to each other: frozen dataclasses of arrays, with units and frames."""
