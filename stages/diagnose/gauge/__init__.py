"""Evidence from a gauge run: poses, rings on a known bore, fiducials and encoder against the stated probe."""
