"""What verdicts on sensors stand on: specimens, evidence, doubts of units, and what to do next."""
