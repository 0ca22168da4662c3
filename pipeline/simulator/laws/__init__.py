"""The closed-form laws of the known effects, each held against the traced or rendered result."""
