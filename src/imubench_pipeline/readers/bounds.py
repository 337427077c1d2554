"""What a log may ask of its reader; beyond it, it is rejected, whatever it says of itself.

Far above what the log of a sensor has, and so low that a reader takes no more than 600 MB, and
says what a file holds within 10 s. docs/reliability.md has what was measured.
"""

# ------------------------------------------------------------------- compression and archives

UNSUSPICIOUS, LARGEST_RATIO = 1 << 28, 800
"""Bytes that compressed data may expand to at least, and how many times their size: a log that
expands further holds nothing but one character."""

LARGEST_WINDOW = 1 << 27
"""Bytes that decompression itself may take: the window of zstd, the dictionary of xz."""

MOST_PARTS, LEAST_IN_PART = 10_000, 64
"""Parts, such as members of gzip, that may hold next to nothing, and bytes that more of them hold
on the average at least."""

LARGEST_DIRECTORY, MOST_MEMBERS = 1 << 21, 1 << 16
"""Bytes of the directory of a zip archive; members of one that has lost it."""

MOST_LOOKED_INTO = 1 << 14
"""Members of an archive among which the one that is text is looked for."""

# --------------------------------------------------------------------------------------- text

MOST_LISTED = 1000
"""Columns of a table, of text or arrays, among which those of the sensor are looked for."""

LONGEST_LINE = 1 << 20
MOST_LINES_BEFORE, MOST_BYTES_BEFORE = 500_000, 1 << 26
"""Lines and bytes in which the first record is looked for."""

COMMENT_LINES, COMMENT_BYTES = 1000, 1 << 23
"""Comments before the first record that are kept."""

# ------------------------------------------------------------------------------------- arrays

MOST_ARRAYS, MOST_FIELDS = 10_000, 1 << 14
"""Arrays of a file; columns of an array of records."""

LARGEST_RECORD = 1 << 26
LARGEST_CHUNKS = 1 << 28
"""Bytes of the chunks of all columns of an HDF5 file together: each is unpacked as a whole."""

MOST_CHUNKS = 1 << 17
"""Of an HDF5 data set: the library takes 2 kB for each."""

LARGEST_ARROW_BATCH = 1 << 28
"""Bytes of a compressed record batch of Feather or Arrow IPC, which is unpacked as a whole."""

LARGEST_PAGES = 1 << 28
MOST_PAGES, LEAST_IN_PAGE = 1 << 17, 1 << 12
"""Bytes that the largest pages of all columns of a Parquet file unpack to together; pages of them,
and bytes that more of them hold on the average at least."""

MOST_OBJECTS, DEEPEST_GROUP = 20_000, 64
"""Objects of an HDF5 file, and groups within each other."""

LONGEST_NPY_HEADER = 10_000
"""Bytes, which NumPy takes, too; but it reads what is said to be there before it looks."""

DEEPEST_STRUCTURE, LONGEST_MATLAB_NAME, MOST_SIDES = 16, 256, 32
"""Of MATLAB 5: structures within each other; bytes of a name, where MATLAB's have 63."""

# --------------------------------------------------------------------------------------- bags

LARGEST_CHUNK, LARGEST_OVERLAP = 1 << 27, 96 << 20
"""Bytes of a chunk or record as unpacked, and of chunks of one time together, which are unpacked
to put their messages in order: those that hold nothing else take five times as much."""

LARGEST_MESSAGE, LARGEST_BATCH = 1 << 16, 1 << 24
"""Bytes of a message with inertial figures, which are 320 and the name of a frame, and of those
that are read together."""

MOST_TOPICS, LONGEST_TOPIC = 10_000, 1024
LARGEST_METADATA = 1 << 20
"""Bytes of metadata.yaml: a topic takes some 300, more with its quality of service."""
