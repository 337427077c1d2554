"""Effect of temperature on a sensor: path, sensitivity and lag, and the noise without it."""
