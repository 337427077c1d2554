"""What users declare, checked: a run, a sensor, its logs and data sheet, requirements, simulations.

Pydantic models of the YAML files, with the units in which they are written.
"""
