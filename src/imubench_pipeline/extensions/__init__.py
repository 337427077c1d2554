"""Extensions beyond static logs, estimates and comparisons; the core imports none of them."""
