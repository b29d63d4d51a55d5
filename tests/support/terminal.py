"""A command in a terminal of its own: keys go in, and what it shows is waited for."""

import os
import pty
import re
import select
import subprocess
import sys
import time
from typing import IO, Self

from tests.support.waiting import WAIT_S


class Terminal:
    """While inside, `gwrms` runs with these arguments; `errors` is where its stderr goes, if not there."""

    def __init__(self, *arguments: str, errors: int | IO[bytes] | None = None) -> None:
        self._ours, theirs = pty.openpty()
        self.program = subprocess.Popen(
            [sys.executable, "-m", "gateway.main", *arguments],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs if errors is None else errors,
        )
        os.close(theirs)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.program.kill()
        self.program.wait()
        os.close(self._ours)

    def press(self, keys: bytes) -> None:
        os.write(self._ours, keys)

    def read_until(self, pattern: str | None) -> None:
        """Read what is shown until it has this, or until nobody shows anything any more."""
        shown, until_s = "", time.monotonic() + WAIT_S
        while time.monotonic() < until_s:
            if not select.select([self._ours], [], [], 0.1)[0]:
                continue
            try:
                shown += os.read(self._ours, 65536).decode(errors="replace")
            except OSError:  # the other end is closed
                assert pattern is None, shown
                return
            if pattern is not None and re.search(pattern, shown, re.DOTALL):
                return
        raise AssertionError(f"{pattern} was not shown: {shown[-2000:]}")
