"""A terminal of its own, in which a command goes on until somebody presses Ctrl-C."""

import contextlib
import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import termios
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from tests.newcomer.comparing import difference
from tests.newcomer.pages import Command

DEADLINE_S: Final = 240.0
ENDS_S: Final = 60.0
LOOK_S: Final = 0.05
ROWS, COLUMNS = 50, 200
CTRL_C: Final = b"\x03"
_CONTROL: Final = re.compile(r"\x1b(?:\[[0-9;:?]*[ -/]*[@-~]|[()][A-Z0-9]|[=>78]|\][^\x07]*\x07)|\r")


class Terminal:
    """A command at a pseudo-terminal, and all that it has shown there."""

    def __init__(self, command: Command, folder: Path, environment: Mapping[str, str]) -> None:
        self._command = command
        self._shown = bytearray()
        self._master, there = pty.openpty()
        self._open = True
        fcntl.ioctl(there, termios.TIOCSWINSZ, struct.pack("4H", ROWS, COLUMNS, 0, 0))
        try:
            self._process = subprocess.Popen(
                ["setsid", "--ctty", "bash", "-c", f"exec {command.typed}"],
                cwd=folder,
                env=environment,
                stdin=there,
                stdout=there,
                stderr=there,
            )
        finally:
            os.close(there)
        self._reader = threading.Thread(target=self._read, name="terminal", daemon=True)
        self._reader.start()

    def wait(self) -> None:
        """Until it has said what the page shows; with nothing shown, until it has shown anything."""
        deadline = time.monotonic() + DEADLINE_S
        shown = (*(self._command.shown or ("…",)), "…")
        while (wrong := difference(shown, self.said)) or not self.said.strip():
            assert self._process.poll() is None, f"{self._command.typed} has ended:\n{self.said}"
            assert time.monotonic() < deadline, wrong or f"{self._command.typed} shows nothing"
            time.sleep(LOOK_S)

    @property
    def said(self) -> str:
        return _CONTROL.sub("", bytes(self._shown).decode("utf-8", errors="replace"))

    def end(self) -> int:
        """Ctrl-C, which all that runs in the terminal hear; the exit status."""
        if self._process.poll() is None:
            with contextlib.suppress(OSError):  # it has ended meanwhile
                os.write(self._master, CTRL_C)
        try:
            return self._process.wait(ENDS_S)
        finally:
            self._close()

    def _close(self) -> None:
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._reader.join(ENDS_S)
        if self._open:
            self._open = False
            os.close(self._master)

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # nobody has it open any more
            while data := os.read(self._master, 65536):
                self._shown += data
