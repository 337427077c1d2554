"""Deterministic signals in a log: detected by likelihood together with noise, and removed from it.

A step of the bias, the exponential of a warm-up and a daily cycle look like a random walk or a slow
process in the spectrum alone, because all of them rise towards low frequencies. Their phases
distinguish them: they are regressors of the cosine transform of the log.
"""
