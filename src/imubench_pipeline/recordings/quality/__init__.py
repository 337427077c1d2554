"""What is wrong with a recording, in findings with a severity."""
