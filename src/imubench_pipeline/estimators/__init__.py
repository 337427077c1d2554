"""Noise parameters: read from the Allan variance, fitted to it, or by the likelihood."""
