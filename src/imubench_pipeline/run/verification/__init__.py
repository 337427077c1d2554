"""`imubench verify`: whether all that runs have left is as they left it."""
