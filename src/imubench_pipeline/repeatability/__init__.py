"""How the fixed bias differs from one turn-on to the next, against what vendors print."""
