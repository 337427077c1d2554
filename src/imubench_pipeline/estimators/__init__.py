"""Noise parameters from a log: read from the curve, fitted to it."""
