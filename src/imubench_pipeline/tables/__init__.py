"""Read, check and write tables; findings, failures, and the digest of the code."""
