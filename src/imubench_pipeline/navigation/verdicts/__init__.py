"""Verdicts on sensors: specimens, evidence, doubtful units, and recommended next steps."""
