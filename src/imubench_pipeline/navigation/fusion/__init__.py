"""Fuse several sensors on one board into one virtual sensor: weights, prediction and filter."""
