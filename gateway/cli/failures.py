"""Failures for programs: with `--json`, what a command has only said on stderr stands on stdout too."""

import contextlib
import sys
from collections.abc import Callable
from typing import Any, Final, TextIO, cast

from gateway.cli.text import YES_OR_NO, say_json

KEPT: Final = 8192  # letters of what was said last
USAGE: Final = 2  # the exit status of what was typed wrong


class _Written:
    """A stream, and whether anything went out by it, and the end of that."""

    def __init__(self, stream: TextIO) -> None:
        self.any = False
        self.end = ""
        self._stream = stream

    def write(self, text: str) -> int:
        self.any = True
        self.end = (self.end + text)[-KEPT:]
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        self.any |= name == "buffer"  # who asks for that writes bytes
        return getattr(self._stream, name)


def with_error_object(run: Callable[[], int]) -> int:
    """Run a command that was asked for JSON; where it fails and has printed nothing, print why."""
    out, said = _Written(sys.stdout), _Written(sys.stderr)
    with contextlib.redirect_stdout(cast("TextIO", out)), contextlib.redirect_stderr(cast("TextIO", said)):
        try:
            status = run()
        except SystemExit as ended:  # argparse has said why
            if ended.code and not out.any:
                _tell(USAGE, said.end)
            raise
    if status and not out.any:
        _tell(status, said.end)
    return status


def _tell(status: int, said: str) -> None:
    kind = "Usage" if status == USAGE else "Failed"
    lines = said.rpartition(YES_OR_NO)[2].strip().splitlines()
    message = "\n".join(line.partition(": ")[2] if line.startswith("gwrms") else line for line in lines)
    say_json({"error": {"kind": kind, "message": message.rpartition("error: ")[2]}})
