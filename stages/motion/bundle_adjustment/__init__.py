"""Bundle adjustment: poses, landmarks, pipe axis and instrument from everything that a window measured."""
