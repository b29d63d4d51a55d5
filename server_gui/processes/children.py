"""Programs that we start, listen to, and end: their first words, their last words, their exit."""

import os
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import IO, Self, TypeVar

Found = TypeVar("Found")

LAST_LINES = 8
HELD_BYTES = 64 * 1024
END_S = 10.0  # a child that does not end within this is killed
MIN_WAIT_S = 0.001


class ChildFailed(Exception):
    """A program of ours ended, or never became ready; the text holds its last words."""


class Output:
    """One stream of a child: read without waiting, the newest `HELD_BYTES` kept."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe = pipe
        self._held = b""
        os.set_blocking(pipe.fileno(), False)

    def fileno(self) -> int:
        return self._pipe.fileno()

    def drain(self) -> None:
        """Read the child's output, so that the child never waits for us."""
        while chunk := self._pipe.read(HELD_BYTES):
            self._held = (self._held + chunk)[-HELD_BYTES:]

    def lines(self) -> list[str]:
        """Return the complete and incomplete lines held."""
        return self._held.decode(errors="replace").splitlines()

    def close(self) -> None:
        self._pipe.close()


class Child:
    """A `gwrms` command in a process of its own, in a group of its own: our Ctrl-C is not its.

    Use it as a context manager: leaving ends it (SIGTERM, after `END_S` SIGKILL) and waits for it. Where we
    are killed, it ends as well, if util-linux is here.
    """

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self.name = name
        setpriv = shutil.which("setpriv")
        ends_with_us = [setpriv, "--pdeathsig", "TERM"] if setpriv else []
        # -P: what lies in the current folder is not imported by accident.
        self._process = subprocess.Popen(
            [*ends_with_us, sys.executable, "-P", "-m", "gateway.main", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            process_group=0,
            bufsize=0,
        )
        if self._process.stdout is None or self._process.stderr is None:
            raise ChildFailed(f"the {name} has no output to read")
        self._out = Output(self._process.stdout)
        self._err = Output(self._process.stderr)

    @property
    def pid(self) -> int:
        return self._process.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.end()

    def wait_ready(
        self, find: Callable[[str], Found | None], within_s: float, meanwhile: Callable[[], None]
    ) -> Found:
        """Wait until `find` gives something else than None for one of its lines, and return that.

        `meanwhile` is called ten times a second, and may raise to give up.

        Raises:
            ChildFailed: it ended first, or said nothing of the kind within `within_s`.

        """
        deadline = time.monotonic() + within_s
        while True:
            meanwhile()
            ended = self._listen()
            for line in self._out.lines():
                if (found := find(line)) is not None:
                    return found
            self._raise_if(ended)
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                raise ChildFailed(f"the {self.name} is not ready after {within_s:g} s. {self.last_words()}")
            select.select([self._out, self._err], [], [], max(MIN_WAIT_S, min(left_s, 0.1)))

    def check(self) -> None:
        """Take its output and look whether it is alive.

        Raises:
            ChildFailed: it has ended.

        """
        self._raise_if(self._listen())

    def last_words(self) -> str:
        """Return the end of what it wrote to stderr."""
        lines = self._err.lines()[-LAST_LINES:]
        return (
            "It said last:\n" + "\n".join(f"  {line}" for line in lines)
            if lines
            else "It wrote nothing to stderr."
        )

    def end(self) -> None:
        """End it and wait. Idempotent."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._wait(END_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._wait(END_S)
        self._out.close()
        self._err.close()

    def _listen(self) -> int | None:
        """Return its exit status, None while it lives; whatever it wrote until then is held."""
        ended = self._process.poll()
        self._out.drain()
        self._err.drain()
        return ended

    def _raise_if(self, ended: int | None) -> None:
        if ended is not None:
            raise ChildFailed(f"the {self.name} has ended ({_exit(ended)}). {self.last_words()}")

    def _wait(self, within_s: float) -> None:
        # It may still have something to say, and would wait for us to hear it.
        deadline = time.monotonic() + within_s
        while self._listen() is None:
            left_s = deadline - time.monotonic()
            try:
                self._process.wait(max(MIN_WAIT_S, min(left_s, 0.05)))
            except subprocess.TimeoutExpired:
                if left_s <= 0:
                    raise


def _exit(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
