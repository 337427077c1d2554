"""Entry point of `imubench`: check the platform before imports that it may lack."""

import os
import signal
import sys

ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM")
} | {"JE_ARROW_MALLOC_CONF": "background_thread:false"}
"""The environment of a process that computes with one thread, and forks to use more cores: threads
that wait for work in each fork would take more time than the work, and Python from 3.12 on warns of
a fork beside a thread of pyarrow. NumPy and pyarrow read it only when they are imported."""


def main() -> int:
    """Run the command of the command line; return its exit status."""
    if os.name != "posix":
        print(
            f"imubench: found the platform {sys.platform}; expected Linux, as it forks processes "
            "and locks files; on Windows, install and run it in WSL, which `wsl --install` sets up",
            file=sys.stderr,
        )
        return 2
    os.environ |= ONE_THREAD | os.environ
    # As an error does, so that no temporary file is left.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    from imubench_pipeline.run.cli import main as run

    try:
        return run()
    except KeyboardInterrupt:
        return 128 + signal.SIGINT


if __name__ == "__main__":
    sys.exit(main())
