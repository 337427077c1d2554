"""The model of a sensor, and logs simulated from it."""
