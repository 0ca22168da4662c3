"""A gauge run as evidence: poses, rings on known bore, fiducials, encoder against the stated instrument."""
