"""Navigation errors from sensor noise: budgets, fusion, pooling, drift, verdicts."""
