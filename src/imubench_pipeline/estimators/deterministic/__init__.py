"""Deterministic signals in a log: detected by likelihood together with noise, and removed from it.

Their phases distinguish them from noise with the same spectrum, such as a random walk.
"""
