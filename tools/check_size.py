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
    too_long = {name: lines for name, lines in lengths.items() if lines > MOST_LINES}
    for name, lines in too_long.items():
        sys.stdout.write(f"{name}: {lines} lines, more than {MOST_LINES}: it is more than one idea\n")
    return len(too_long) > 0


if __name__ == "__main__":
    sys.exit(main())
