"""Entry point of `imubench`: check the platform before imports that it may lack."""

import os
import signal
import sys

ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM")
} | {"JE_ARROW_MALLOC_CONF": "background_thread:false"}
"""The environment of a process that computes with one core, and forks for the others: threads of a
library that spin for work in each fork take more core time than the work itself, and Python from
3.12 on warns of each fork of a process that has another thread, as pyarrow starts for an allocator
that it does not use. NumPy and pyarrow ask for it when they are imported, and never again."""


def main() -> int:
    """Run the command of the command line; return its exit status."""
    if os.name != "posix":
        print(
            f"imubench: found the platform {sys.platform}; expected Linux, as it forks processes "
            "and locks files; to mend: on Windows, install and run it in WSL, which `wsl "
            "--install` sets up",
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
