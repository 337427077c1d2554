"""What goes beyond static logs, estimates and comparisons: packages that nothing else imports."""
