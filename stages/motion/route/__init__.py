"""Route: which straight lengths and bends the pipe has, and where these and an IMU place it in space."""
