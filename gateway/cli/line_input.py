"""Input from a terminal or pipe: lines, and whether some can be read without waiting."""

import os
import re
import select

STDIN = 0
CHUNK = 4096
TURN_S = 0.2  # of a wait: Python hears a signal that came just before one only after it

STOP_WORD = re.compile(r"\bstop\b", re.IGNORECASE)
OBJECT_MARKS = frozenset("{[\"'")  # before that word: an object that went wrong on its way


def looks_like_stop(text: str, *, press: bool = False) -> bool:
    """Return whether a line that is no answer has this word alone, or within what looks like an object.

    Where only Enter is asked for (`press`), whatever has it is a stop.
    """
    word = STOP_WORD.search(text)
    if press or word is None:
        return "stop" in text.lower() if press else False
    is_object = not OBJECT_MARKS.isdisjoint(text[: word.start()])
    return is_object or not any(map(str.isalnum, STOP_WORD.sub("", text)))


class Typed:
    """The standard input, read by nobody else: what Python's own reader holds back could be a STOP."""

    def __init__(self, descriptor: int = STDIN) -> None:
        self._descriptor = descriptor
        self._held = b""
        self._over = False

    def line(self) -> str:
        """Return the next line, with its end; raises `EOFError` where none comes any more."""
        while b"\n" not in self._held and not self._over:
            if self._ready(TURN_S):
                self._read()
        if not self._held:
            raise EOFError
        line, end, self._held = self._held.partition(b"\n")
        return (line + end).decode(errors="replace")

    def waits(self, seconds: float) -> str:
        """Wait at most so long; return why nothing is to go on: a key, or nobody can press one any more."""
        if not self._held and not self._over and self._ready(seconds):
            self._read()
        if self._held:
            return "STOP was pressed"
        return "nobody can press STOP any more: its input has ended" if self._over else ""

    def drop(self) -> None:
        """Forget what was typed meanwhile: it was not an answer."""
        while not self._over and self._ready(0.0):
            self._read()
        self._held = b""

    def _ready(self, seconds: float) -> bool:
        try:
            return bool(select.select([self._descriptor], [], [], seconds)[0])
        except OSError:  # closed: reading tells
            return True

    def _read(self) -> None:
        try:
            came = os.read(self._descriptor, CHUNK)
        except OSError:  # a terminal that was closed
            came = b""
        self._held += came
        self._over = not came
