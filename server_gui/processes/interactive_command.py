"""An interactive command, on this computer or by SSH on another, served by a thread of its own."""

import contextlib
import os
import select
import shlex
import shutil
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import IO, Final

from server_gui.core.commissioning.commissioning import Exit

MOST_HEARD: Final = 10_000  # lines that may wait for a window that hangs
LONGEST: Final = 1 << 20  # of a line, in bytes
LAST_LINES: Final = 8
CHUNK: Final = 64 * 1024
END_S: Final = 5.0  # after which a command that was asked to end is killed
LOOK_S: Final = 0.1  # between two looks whether it runs
LINGER_S: Final = 1.0  # for its last words, once it has ended
HERE: Final = (sys.executable, "-P", "-m", "gateway.main")
# No password is asked for, and a connection that is gone is noticed within some seconds.
SSH: Final = (
    *("ssh", "-T", "-o", "BatchMode=yes", "-o", "ConnectTimeout=10"),
    *("-o", "ServerAliveInterval=2", "-o", "ServerAliveCountMax=3", "--"),
)


def talk(arguments: Sequence[str], computer: str = "") -> "InteractiveCommand":
    """Start `gwrms` with these arguments, and talk to it; on another computer it ends with the connection."""
    there = [*SSH, computer, shlex.join(["gwrms", *arguments])]
    return InteractiveCommand(there if computer else [*HERE, *arguments])


class InteractiveCommand:
    """One command in a process of its own, in a group of its own; where we are killed, it is ended too."""

    def __init__(self, command: Sequence[str]) -> None:
        self._command = command
        self._heard: deque[str] = deque(maxlen=MOST_HEARD)
        self._to_send: deque[bytes] = deque()
        self._errors: deque[str] = deque(maxlen=LAST_LINES)
        self._exit: Exit | None = None
        self._asked_to_end_s: float | None = None
        self._is_to_die = False
        self._woken, self._wake = os.pipe()
        os.set_blocking(self._wake, False)
        self._waking = threading.Lock()  # nobody wakes who has gone
        self._thread = threading.Thread(target=self._run, name="talking", daemon=True)
        self._thread.start()

    @property
    def ended(self) -> Exit | None:
        return None if self._heard else self._exit

    def heard(self) -> list[str]:
        return [self._heard.popleft() for _ in range(len(self._heard))]

    def send(self, line: str) -> None:
        self._to_send.append(line.encode() + b"\n")
        self._wake_up()

    def end(self) -> None:
        """SIGTERM, and where that does not help, SIGKILL."""
        if self._asked_to_end_s is None:
            self._asked_to_end_s = time.monotonic()
        self._wake_up()

    def kill(self) -> None:
        self._is_to_die = True
        self._wake_up()

    def join(self, within_s: float) -> bool:
        self._thread.join(within_s)
        return not self._thread.is_alive()

    # --- in the thread

    def _run(self) -> None:
        try:
            setpriv = shutil.which("setpriv")
            ends_with_us = [setpriv, "--pdeathsig", "TERM"] if setpriv else []
            process = subprocess.Popen(
                [*ends_with_us, *self._command],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                process_group=0,
                bufsize=0,
            )
        except OSError as error:
            self._exit = Exit(None, f"{self._command[0]}: {error.strerror or error}")
        else:
            with process:
                self._serve(process)
            self._exit = Exit(process.returncode, "\n".join(self._errors))
        with self._waking:
            os.close(self._wake)
            os.close(self._woken)
            self._wake = -1

    def _serve(self, process: "subprocess.Popen[bytes]") -> None:
        """Serve it until it has ended and said all; then close its pipes, whoever else holds them."""
        if process.stdin is None or process.stdout is None or process.stderr is None:
            return
        os.set_blocking(process.stdin.fileno(), False)
        lines = {process.stdout: Lines(self._heard), process.stderr: Lines(self._errors)}
        gone_s: float | None = None
        termed = False
        while lines:
            sources: list[IO[bytes] | int] = [*lines, self._woken]
            ready, _, _ = select.select(sources, [], [], LOOK_S)
            for pipe in [one for one in lines if one in ready]:
                if not lines[pipe].read(pipe):
                    del lines[pipe]
            if self._woken in ready:
                os.read(self._woken, CHUNK)
            self._write(process.stdin)
            termed = self._end_where_asked(process, termed=termed)
            if process.poll() is not None:
                gone_s = time.monotonic() if gone_s is None else gone_s
                if time.monotonic() - gone_s > LINGER_S:
                    return
        self._await(process, termed=termed)

    def _await(self, process: "subprocess.Popen[bytes]", *, termed: bool) -> None:
        """One that says nothing any more may still run."""
        self.end()
        while process.poll() is None:
            termed = self._end_where_asked(process, termed=termed)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(LOOK_S)

    def _write(self, pipe: IO[bytes]) -> None:
        while self._to_send:
            with contextlib.suppress(OSError):  # it has ended, or takes nothing: then it does not hear it
                pipe.write(self._to_send[0])
            self._to_send.popleft()

    def _end_where_asked(self, process: "subprocess.Popen[bytes]", *, termed: bool) -> bool:
        asked_s = self._asked_to_end_s
        if self._is_to_die or (asked_s is not None and time.monotonic() - asked_s > END_S):
            process.kill()
        elif asked_s is not None and not termed:
            process.terminate()
            return True
        return termed

    def _wake_up(self) -> None:
        with self._waking, contextlib.suppress(BlockingIOError):
            if self._wake >= 0:
                os.write(self._wake, b"\n")


class Lines:
    """The lines of one pipe; one that is too long is let go."""

    def __init__(self, into: deque[str]) -> None:
        self._into = into
        self._held = b""

    def read(self, pipe: IO[bytes]) -> bool:
        """Read the pipe; return whether there may be more."""
        chunk = pipe.read(CHUNK) or b""
        *lines, self._held = (self._held + chunk).split(b"\n")
        if not chunk and self._held:
            lines, self._held = [self._held], b""
        if len(self._held) > LONGEST:
            self._held = b""
        self._into.extend(line.decode(errors="replace") for line in lines)
        return bool(chunk)
