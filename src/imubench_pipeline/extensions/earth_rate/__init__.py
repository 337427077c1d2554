"""The Earth's rotation from a gyro turned between north and south (Silva et al., section 6, 7)."""
