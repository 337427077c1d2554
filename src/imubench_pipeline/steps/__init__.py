"""What the rules of the workflow compute: files and settings in, library calls, rows out."""
