"""Steps of the workflow: read files and settings, call the library, write rows."""
