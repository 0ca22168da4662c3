"""What stages hand to each other: frozen dataclasses of arrays, with units and frames."""
