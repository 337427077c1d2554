"""Printed figures in comparable terms, and beside what was measured."""
