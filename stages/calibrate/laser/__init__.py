"""The laser plane from pictures of a board with the laser line across it."""
