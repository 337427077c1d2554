"""Back-test of an error budget: dead reckoning over windows of the log."""
