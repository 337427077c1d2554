"""The Earth's rotation from a gyro that is turned between north and south (003 section 6, 7)."""
