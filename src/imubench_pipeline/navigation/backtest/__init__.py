"""What a log shows of its own error budget: dead reckoning over windows of it, and the budget."""
