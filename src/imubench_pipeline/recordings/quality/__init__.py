"""Quality checks of a recording, as findings with a severity."""
