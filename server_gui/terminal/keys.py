"""Keys of a terminal: bytes to names, and a terminal that hands them over one by one."""

import os
import select
import sys
from enum import Enum
from typing import Self


class Key(Enum):
    """Keys of the dashboard."""

    UP = "up"
    DOWN = "down"
    LEFT = "left"
    RIGHT = "right"
    STOP = "s"
    RESET = "r"
    QUIT = "q"


# What terminals send: CSI in normal, SS3 in application mode (ECMA-48, DEC VT100).
SEQUENCES = {
    b"\x1b[A": Key.UP,
    b"\x1b[B": Key.DOWN,
    b"\x1b[C": Key.RIGHT,
    b"\x1b[D": Key.LEFT,
    b"\x1bOA": Key.UP,
    b"\x1bOB": Key.DOWN,
    b"\x1bOC": Key.RIGHT,
    b"\x1bOD": Key.LEFT,
    b"k": Key.UP,
    b"j": Key.DOWN,
    b"h": Key.LEFT,
    b"l": Key.RIGHT,
    b"-": Key.LEFT,
    b"+": Key.RIGHT,
    b"s": Key.STOP,
    b"S": Key.STOP,
    b" ": Key.STOP,
    b"r": Key.RESET,
    b"R": Key.RESET,
    b"q": Key.QUIT,
    b"Q": Key.QUIT,
}


class KeyParser:
    """Bytes in, keys out; an escape sequence may come in pieces, what is unknown is dropped."""

    def __init__(self) -> None:
        self._held = b""

    def feed(self, data: bytes) -> list[Key]:
        """Return the keys that `data` completes."""
        held = self._held + data
        keys: list[Key] = []
        while held:
            length = _length(held)
            if length is None:
                break
            key = SEQUENCES.get(held[:length])
            if key is not None:
                keys.append(key)
            held = held[length:]
        self._held = held[:16]
        return keys


def _length(held: bytes) -> int | None:
    """Return bytes of the sequence at the start, None while it is incomplete."""
    if held[:1] != b"\x1b":
        return 1
    if len(held) < 2:
        return None
    if held[1:2] == b"O":
        return 3 if len(held) >= 3 else None
    if held[1:2] != b"[":
        return 1  # a lone escape
    for index, byte in enumerate(held[2:], start=2):
        if 0x40 <= byte <= 0x7E:
            return index + 1
    return None if len(held) < 16 else len(held)


class Keyboard:
    """The terminal at stdin, without echo and without waiting for Enter; as it was before on leaving.

    Where stdin is no terminal, it waits just as long and gives no keys.
    """

    def __init__(self) -> None:
        import termios  # not on Windows
        import tty

        self._termios, self._tty = termios, tty
        self._fd = sys.stdin.fileno() if sys.stdin.isatty() else None
        self._parser = KeyParser()
        self._before: list[int | list[bytes | int]] | None = None

    def __enter__(self) -> Self:
        if self._fd is not None:
            self._before = self._termios.tcgetattr(self._fd)
            self._tty.setcbreak(self._fd)
        return self

    def __exit__(self, *exc: object) -> None:
        if self._fd is not None and self._before is not None:
            self._termios.tcsetattr(self._fd, self._termios.TCSADRAIN, self._before)

    def wait(self, timeout_s: float) -> list[Key]:
        """Return the keys pressed; returns at the first ones, or after `timeout_s` with none."""
        watched = [] if self._fd is None else [self._fd]
        ready, _, _ = select.select(watched, [], [], max(0.0, timeout_s))
        if self._fd is None or not ready:
            return []
        data = os.read(self._fd, 1024)
        if not data:
            self._fd = None  # the terminal is gone
        return self._parser.feed(data)
