"""What temperature does to a sensor: its path, the sensitivity and lag, and the noise without."""
