"""What is no noise in a log: found beside it by likelihood, and taken out of it.

A step of the bias, the exponential of a warm-up or the course of a day pass for a random walk or
a slow process where a spectrum alone is looked at, for all of them rise towards low frequencies.
They are told apart by their phases: the cosine transform of the log has them as regressors.
"""
