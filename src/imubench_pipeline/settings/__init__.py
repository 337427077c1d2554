"""Validated declarations of users: run, sensors, logs, datasheets, requirements, simulations.

Pydantic models of the YAML files, with the units in which they are written.
"""
