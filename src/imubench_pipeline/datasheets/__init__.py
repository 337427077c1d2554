"""Convert datasheet figures to comparable quantities, and compare them with measurements."""
