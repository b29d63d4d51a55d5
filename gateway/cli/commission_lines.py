"""Commissioning for other programs: what is said and asked as JSON lines, and lines that answer.

Out come, a line each: `{"say": …}`, `{"ask": …, "number": …, …}`, `{"live": […], "number": …}` while a
question waits, `{"steps": […]}`, at the end `{"written": …}`; `{"stopped": …}` after a stop, with what is
known of each drive and after how many ms it confirmed. In go plain lines, each the answer to the next
question; or `{"answer": …, "number": …}`, which answers that question alone and is passed over where it
comes late or twice; or `{"stop": true}` at any time.

`{"moving": …}` comes again and again while a joint is under power, and any line is a STOP then; `{"moving":
null}` when that is over.
"""

import contextlib
import os
import queue
import select
import signal
import sys
import threading
import time
from typing import Any, Self

import msgspec

from drivers.errors import DriverError
from drivers.inbox import Inbox
from gateway.cli.line_input import looks_like_stop
from gateway.cli.text import say_json
from gateway.commission.dialogue import Ask, Live
from gateway.commission.progress import CommissionStep
from gateway.commission.writing import Written

LOOK_S = 0.03  # for a STOP, each time
SHOW_S = 0.5  # between two words of a joint that moves
LIVE_S = 0.2  # between two looks while a question waits; a signal just before a wait is heard after it
CHUNK = 4096
LONGEST = 65_536  # of a line; whoever sends a longer one is not heard any more


class Answer(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A line that is no plain answer."""

    answer: str = ""
    number: int | None = None  # of the question; None: whichever is asked next
    stop: bool = False


class Lines:
    """Input lines, read by a thread of its own, so that a stop is noticed during other work."""

    def __init__(self, source: int) -> None:
        self.stop_asked = False
        self._source = source
        self._read: Inbox[Answer | None] = Inbox()
        self._woken, self._wake = os.pipe()
        self._main = threading.main_thread().ident or 0
        self._thread = threading.Thread(target=self._run, name="answers", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        os.write(self._wake, b"\n")
        self._thread.join()
        os.close(self._wake)
        os.close(self._woken)

    def get(self, number: int, within_s: float) -> str | None:
        """Return the answer to question `number`; `None` where none has come.

        Raises `EOFError` after the last.
        """
        try:
            while (read := self._read.get(timeout=within_s)) is not None:
                if read.number in (None, number):
                    return read.answer
        except queue.Empty:
            return None
        self._read.put(None)
        raise EOFError

    def waits(self, within_s: float) -> str:
        """Wait at most so long; return why nothing is to go on: a line, or nobody can send one any more."""
        try:
            read = self._read.get(timeout=within_s)
        except queue.Empty:
            return ""
        self._read.put(read)
        return (
            "STOP was pressed" if read is not None else "nobody can press STOP any more: its input has ended"
        )

    def drop(self) -> None:
        """Forget what came meanwhile: it was not an answer."""
        is_over = False
        with contextlib.suppress(queue.Empty):
            while True:
                is_over |= self._read.get_nowait() is None
        if is_over:
            self._read.put(None)

    def _run(self) -> None:
        held = b""
        while True:
            ready, _, _ = select.select([self._source, self._woken], [], [])
            chunk = b"" if self._woken in ready else self._chunk()
            *lines, held = (held + chunk).split(b"\n")
            if not chunk or len(held) > LONGEST:
                lines += [held] if held and not chunk else []
            for line in lines:
                self._take(line)
            if not chunk or len(held) > LONGEST:
                self._read.put(None)
                return

    def _chunk(self) -> bytes:
        try:
            return os.read(self._source, CHUNK)
        except OSError:  # a terminal that was closed
            return b""

    def _take(self, line: bytes) -> None:
        read = _read(line.decode(errors="replace").strip())
        if not read.stop:
            self._read.put(read)
        else:
            self.stop()

    def stop(self) -> None:
        """End the dialogue in the main thread, so that every drive is stopped; from any thread."""
        if not self.stop_asked:
            self.stop_asked = True
            signal.pthread_kill(self._main, signal.SIGINT)


def _read(text: str) -> Answer:
    """Return what a line says: whatever could be meant as a stop is one; what is no answer is plain text."""
    try:
        found = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError):
        found = None
    if not isinstance(found, dict):
        return Answer(stop=True) if looks_like_stop(text) else Answer(text)
    said = [value for key, value in found.items() if key.lower() == "stop"]
    if any(said) or (not said and "answer" not in found and looks_like_stop(text)):
        return Answer(stop=True)
    try:
        return msgspec.convert(found, Answer) if "answer" in found else Answer(text)
    except msgspec.ValidationError:
        return Answer(text)


class JsonFace:
    """The dialogue for a program; `at` of its progress is told beside it."""

    def __init__(self, lines: Lines) -> None:
        self._lines = lines
        self._number = 0
        self._steps: tuple[CommissionStep, ...] = ()
        self._moving_s = 0.0  # when words of a motion were told; 0: nothing moves

    @property
    def stop_asked(self) -> bool:
        return self._lines.stop_asked

    def moving(self, text: str) -> str:
        if time.monotonic() - self._moving_s > SHOW_S:
            self._moving_s = time.monotonic()
            say_json({"moving": text})
        return self._lines.waits(LOOK_S)

    def _rest(self) -> None:
        """Note that a motion, if any, is over."""
        if self._moving_s:
            self._moving_s = 0.0
            self._lines.drop()
            say_json({"moving": None})

    def say(self, text: str) -> None:
        self._rest()
        say_json({"say": text})

    def propose(self, made: str, file: str) -> None:
        """Send the file as it would be written."""
        say_json({"say": made, "file": file})

    def written(self, written: Written) -> None:
        say_json({"written": written})
        say_json({"say": written.words})

    def steps(self, steps: tuple[CommissionStep, ...]) -> None:
        """Report the progress, if it has changed."""
        if steps != self._steps:
            self._steps = steps
            say_json({"steps": steps})

    def ask(self, question: Ask) -> str:
        self._rest()
        self._number += 1
        asked: dict[str, Any] = {"ask": question.text, "number": self._number}
        for key in ("choices", "default", "unit", "bounds", "press", "refused"):
            asked[key] = getattr(question, key)
        say_json(asked)
        within_s = LIVE_S if question.live is None else 0.0
        while (typed := self._lines.get(self._number, within_s)) is None:
            if question.live is not None:
                self._show(question.live)
                within_s = LIVE_S
        if question.press and looks_like_stop(typed, press=True):
            self._lines.stop()
        return typed

    def _show(self, live: Live) -> None:
        try:
            say_json({"live": live(), "number": self._number})
        except DriverError as error:
            say_json({"live": [], "number": self._number, "problem": str(error)})


def stdin() -> int:
    """Return the descriptor that answers come from."""
    return sys.stdin.fileno()
