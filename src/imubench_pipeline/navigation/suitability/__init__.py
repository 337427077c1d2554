"""Whether a sensor suits an application: what it must have, and on what its verdict rests."""
