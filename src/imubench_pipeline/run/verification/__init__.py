"""`imubench verify`: verify that the outputs of runs are unchanged."""
