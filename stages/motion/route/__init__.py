"""Route: finds the pipe's straight lengths and bends, and its course in space by these and an IMU."""
