"""A folder that was filled once, and is as it was then for each test: a copy takes a tenth of the time."""

import shutil
from collections.abc import Callable
from pathlib import Path


class Filled:
    """Always in the same place: a spool knows the address of its store."""

    def __init__(self, folder: Path, fill: Callable[[Path], None]) -> None:
        self._now, self._first = folder / "now", folder / "first"
        fill(self._now)
        shutil.copytree(self._now, self._first)

    def anew(self) -> Path:
        shutil.rmtree(self._now)
        shutil.copytree(self._first, self._now)
        return self._now
