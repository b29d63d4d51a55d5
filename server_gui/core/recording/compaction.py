"""A store that stays quick: now and then its small files are put together, by a process beside this one.

Each file of a table costs who writes to it memory and time, and a robot brings one a batch. A process of its
own, because what compaction holds meanwhile would stay ours.
"""

import json
import logging
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

log = logging.getLogger(__name__)

NICENESS: Final = 10  # recording goes first
END_S: Final = 5.0
COMMAND: Final = ("-P", "-m", "gateway.main", "cloud", "compact", "--json")


class Compacting:
    """Runs `gwrms cloud compact` every so often, for one thread; in `folder` it notes when it last has."""

    def __init__(self, url: str, folder: Path, every_s: float) -> None:
        self._url = url
        self._noted = folder / "compacted"
        self._every_s = every_s
        self._process: subprocess.Popen[str] | None = None
        self._problem = ""  # that kept it from beginning or ending, last

    def look(self) -> None:
        """Begin when it is time, or see to what was begun; returns at once. What fails is said in the log."""
        try:
            if self._process is None:
                if self._is_due():
                    self._begin()
            elif self._process.poll() is not None:
                process, self._process = self._process, None
                self._ended(process)
        except (OSError, ValueError) as error:  # no memory or file for a process; what it said is cut off
            if str(error) != self._problem:
                log.warning("the store was not compacted: %s", error)
            self._problem = str(error)

    def close(self) -> None:
        """End what was begun: nothing of it counts then, and nothing is lost. Idempotent."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
        self._process = None

    def _is_due(self) -> bool:
        try:
            since_s = time.time() - self._noted.stat().st_mtime
            return abs(since_s) >= self._every_s  # a clock that was set back would put it off for ever
        except FileNotFoundError:  # the first time of all: there is not much yet
            self._noted.touch()
            return False

    def _begin(self) -> None:
        self._noted.touch()
        self._process = subprocess.Popen(
            [sys.executable, *COMMAND, self._url],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,  # our Ctrl-C is not its
        )
        self._problem = ""
        os.setpriority(os.PRIO_PROCESS, self._process.pid, NICENESS)

    def _ended(self, process: subprocess.Popen[str]) -> None:
        told, problem = process.communicate()
        if process.returncode:
            log.warning("the store was not compacted: %s", problem.strip())
            return
        tables = json.loads(told)
        before, after = (sum(table[key] for table in tables) for key in ("files_before", "files_after"))
        log.info("the store's %d files were put together into %d", before, after)
