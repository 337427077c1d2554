"""Noise parameters of the Allan variance, with intervals that hold for sensors that change."""
