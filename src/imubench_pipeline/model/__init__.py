"""Types of the data: the rows of every table, and the values passed between packages."""
