"""What the program knows, typed: the rows of every table, and what passes between rooms."""
