"""Bundle adjustment: poses, landmarks, pipe axis and instrument from all measurements of a window."""
