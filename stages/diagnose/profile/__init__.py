"""Evidence from the line's profile: width, skewness, ghosts, brightness, and patterns fixed to the sensor."""
