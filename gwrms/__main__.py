"""`python -m gwrms`: the command, without anything from the working folder, as `python -P` has it."""

import sys
from pathlib import Path

HOME = str(Path(__file__).resolve().parents[1])

if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]
    if HOME not in sys.path:  # a working copy that is the working folder
        sys.path.insert(0, HOME)
    from gwrms.command import main

    sys.exit(main())
