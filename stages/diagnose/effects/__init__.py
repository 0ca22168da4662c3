"""How each known effect changes the measurements; one module per family of effects."""
