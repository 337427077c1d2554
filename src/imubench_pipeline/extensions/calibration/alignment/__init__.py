"""The attitude of a triad of gyros and accelerometers at rest, from gravity and Earth's rate."""
