"""Before buying: which sensors of the catalogue are worth logging for a requirement.

`figures` reads datasheets by all conventions that they leave open, `classes` fills what vendors do
not publish with what is measured of sensors of the same class, and `rows` holds both ends against
the limits of a requirement.
"""
