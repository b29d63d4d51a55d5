"""`python -m tools.check_size`: no file of Python is too long to be one idea; run by `./dev lint`."""

import subprocess
import sys
from pathlib import Path
from typing import Final

MOST_LINES: Final = 500


def main() -> int:
    """Name the files that are too long; how many there are decides the exit status."""
    listed = subprocess.run(["git", "ls-files", "*.py"], capture_output=True, text=True, check=True)
    lengths = {
        name: len(Path(name).read_text(encoding="utf-8").splitlines()) for name in listed.stdout.split()
    }
    for name, lines in lengths.items():
        if lines > MOST_LINES:
            sys.stdout.write(f"{name}: {lines} lines, more than {MOST_LINES}: it is more than one idea\n")
    return any(lines > MOST_LINES for lines in lengths.values())


if __name__ == "__main__":
    sys.exit(main())
