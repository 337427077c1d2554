"""`imubench analyse`: analyse logs directly by the steps of the workflow, without a project."""
