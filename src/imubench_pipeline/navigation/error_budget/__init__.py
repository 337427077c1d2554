"""Dead-reckoning errors from a noise model, by source."""
