"""Where `imubench` begins: it says where it cannot run, before it imports what is not there."""

from __future__ import annotations

import os
import sys


def main() -> int:
    """Run the command that is given; return its exit status."""
    if os.name != "posix":
        print(
            f"imubench: found the platform {sys.platform}; expected Linux, as it forks processes "
            "and locks files; to mend: on Windows, install and run it in WSL, which `wsl "
            "--install` sets up",
            file=sys.stderr,
        )
        return 2
    from imubench_pipeline.run.cli import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
