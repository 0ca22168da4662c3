"""What must hold for a scene to show what it is meant to show; checked before and after rendering."""
