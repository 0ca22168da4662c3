"""The line's profile as evidence: width, skewness, ghosts, brightness, what is fixed to the sensor."""
