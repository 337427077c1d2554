"""What a ROS bag may ask for: beyond it, it is no log of a sensor, whatever it says of itself."""

LARGEST_CHUNK = 1 << 27
"""Bytes of a chunk or record as unpacked: they are in memory together."""

LARGEST_OVERLAP = 1 << 28
"""Bytes of chunks of one time, which are unpacked together to put their messages in order."""

LARGEST_MESSAGE = 1 << 16
"""Bytes of a message with inertial figures: they are 320, and the name of a frame."""

LARGEST_BATCH = 1 << 24
"""Bytes of messages that are read together."""

UNSUSPICIOUS, LARGEST_RATIO = 1 << 28, 800
"""Bytes that a bag may expand to at least, and how many times its size."""

MOST_TOPICS = 10_000
LONGEST_NAME = 1024
LARGEST_METADATA = 1 << 20
"""Bytes of metadata.yaml: a topic takes some 300, more with its quality of service."""
