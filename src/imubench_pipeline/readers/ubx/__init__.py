"""UBX messages of u-blox receivers."""
