"""The wall of a simulated pipe: its shape, reflectance and gloss on a grid about its axis."""
