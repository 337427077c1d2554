"""A run: its plan, its processes and what they may use, its progress, its nights, its commands."""
