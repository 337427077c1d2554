"""Resource limits of the readers: a log that exceeds one of them is rejected.

The limits are far above the logs of real sensors. They keep a reader below 600 MB, and the
inspection of a file below 10 s. The measurements are in docs/reliability.md.
"""

# ------------------------------------------------------------------- compression and archives

MIN_CHECKED_EXPANSION, MAX_EXPANSION_RATIO = 1 << 28, 800
"""Bytes to which any compressed data may expand, and largest ratio of expansion above that: only
the repetition of one character expands further."""

MAX_WINDOW = 1 << 27  # memory of the decompression, bytes: the window of zstd, the dictionary of xz
MAX_UNCHECKED_PARTS, MIN_MEAN_PART = 10_000, 64  # that may be nearly empty; mean bytes beyond
MAX_DIRECTORY, MAX_MEMBERS = 1 << 21, 1 << 16  # bytes of a zip directory; members without one
MAX_ARCHIVE_PROBES = 1 << 14  # members of an archive that are searched for the only text file

# --------------------------------------------------------------------------------------- text

MAX_SEARCHED_COLUMNS = 1000  # columns of a table that are searched for the sensor
MAX_LINE_LENGTH = 1 << 20  # bytes of a line of text
MAX_LINES_BEFORE, MAX_BYTES_BEFORE = 500_000, 1 << 26  # searched for the first record
MAX_COMMENT_LINES, MAX_COMMENT_BYTES = 1000, 1 << 23  # stored before the first record

# ------------------------------------------------------------------------------------- arrays

MAX_ARRAYS, MAX_FIELDS = 10_000, 1 << 14  # arrays of a file; columns of an array of records
MAX_BLOCK_BYTES = 1 << 26  # bytes of a block of records, which may be a single record
MAX_CHUNK_BYTES = 1 << 28  # bytes of a chunk of each HDF5 column: they are unpacked whole
MAX_CHUNKS = 1 << 17  # chunks of an HDF5 data set: the library takes 2 kB for each
MAX_OBJECTS, MAX_GROUP_DEPTH = 20_000, 64  # objects of an HDF5 file, and depth of nested groups
MAX_NPY_HEADER = 10_000  # bytes; NumPy has the same limit, but reads a header first
MAX_STRUCTURE_DEPTH, MAX_MATLAB_NAME, MAX_DIMENSIONS = 16, 256, 32  # of MATLAB 5; bytes of a name

MAX_ULOG_FIELDS = 1024  # numbers of a message of ULog, and its topics; PX4 has some hundred
MAX_SHEETS, MAX_SHEET_MEMORY = 100, 1 << 30
"""Sheets of a workbook that are read, and memory of the process that reads them, bytes: a sheet has
at most 2**20 rows."""

# --------------------------------------------------------------------------------------- bags

MAX_BAG_CHUNK, MAX_BAG_OVERLAP = 1 << 27, 96 << 20
"""Unpacked bytes of a chunk or record, and of all chunks that overlap in time, which are unpacked
together to sort their messages: the messages take up to five times as much memory."""

MAX_MESSAGE, MAX_MESSAGE_BATCH = 1 << 16, 1 << 24  # bytes of one (320 and a name), and of many
MAX_TOPICS, MAX_TOPIC_LENGTH = 10_000, 1024  # topics of a bag, and bytes of the name of a topic
MAX_METADATA = 1 << 20  # bytes of metadata.yaml: a topic takes some 300
