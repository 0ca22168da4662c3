"""What each effect of the catalogue does to picture, ring and encoder: all computed, for the gallery page."""
