"""`imubench nightly`: what a timer calls, while loggers write."""
