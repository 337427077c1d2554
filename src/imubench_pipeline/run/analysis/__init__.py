"""`imubench analyse`: logs at once, by the steps of the workflow, without a project."""
