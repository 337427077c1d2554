"""Experiments with known rates: the Earth's rate, biases and scale factors, attitude.

Arrays in, estimates out; `steps` reads the logs for them.
"""
