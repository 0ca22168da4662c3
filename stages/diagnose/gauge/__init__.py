"""A gauge run as evidence: poses, rings on known bore, fiducials and encoder against the stated instrument."""
