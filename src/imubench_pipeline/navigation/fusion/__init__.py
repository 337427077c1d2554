"""Several sensors on one board as one virtual sensor: weights, what they give, and the filter."""
