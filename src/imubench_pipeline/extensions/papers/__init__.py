"""Claims of the papers behind this project, with the results of this project."""
