"""A run: plan, processes with their limits, progress, and commands."""
