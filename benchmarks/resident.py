"""Peak resident memory of a process (Linux)."""

from pathlib import Path


def peak_memory() -> float:
    """Return the peak resident memory of this process, MB.

    That of ``getrusage`` begins with the size of the process that started this one.
    """
    status = Path("/proc/self/status").read_text()
    return float(status.partition("VmHWM:")[2].split()[0]) * 1024 / 1e6
