"""What the papers behind this project print, line by line, beside what is found here."""
