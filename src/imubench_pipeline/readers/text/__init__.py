"""Text logs, with automatic detection of delimiter, header and time stamps."""
