"""What noise means for use: error budgets, fusion, pools, drift, requirements and verdicts."""
