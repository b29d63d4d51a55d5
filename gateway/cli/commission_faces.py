"""The faces of `gwrms commission`: a terminal for people, JSON lines for other faces; both have a STOP."""

import time
from collections.abc import Callable

from gateway.cli.text import say, say_json
from gateway.cli.typed import Typed
from gateway.commission.dialogue import Ask

LOOK_S = 0.03  # for a STOP, each time
SHOW_S = 0.5  # between two words of a joint that moves


class _Face:
    """What both have: lines that come in, and a STOP that is looked for."""

    def __init__(self) -> None:
        self.typed = Typed()
        self._shown = 0.0  # when words of a motion were shown; 0: nothing moves

    def stop_wanted(self, show: Callable[[], None]) -> str:
        if time.monotonic() - self._shown > SHOW_S:
            self._shown = time.monotonic()
            show()
        return self.typed.waits(LOOK_S)

    def over(self) -> bool:
        """Whether a motion has ended since."""
        ended, self._shown = self._shown > 0, 0.0
        if ended:
            self.typed.drop()
        return ended


class Terminal(_Face):
    """Words, and lines that are typed."""

    def say(self, text: str) -> None:
        self.over()
        say(text + "\n")

    def moving(self, text: str) -> str:
        return self.stop_wanted(lambda: say(f"  {text}\n"))

    def ask(self, question: Ask) -> str:
        choices = f" [{'/'.join(question.choices)}]" if question.choices else ""
        default = f" (Enter: {question.default})" if question.default else ""
        self.over()
        say(f"\n{question.text}{choices}{default}\n> ")
        return self.typed.line()


class JsonFace(_Face):
    """A line each: {"say": …} and {"ask": …, "choices": …, "default": …, "unit": …}; plain lines answer.

    {"moving": …} comes again and again while a joint is under power: any line is a STOP.
    {"moving": null} comes when that is over.
    """

    def say(self, text: str) -> None:
        self._end()
        say_json({"say": text})

    def moving(self, text: str) -> str:
        return self.stop_wanted(lambda: say_json({"moving": text}))

    def _end(self) -> None:
        if self.over():
            say_json({"moving": None})

    def ask(self, question: Ask) -> str:
        self._end()
        say_json(
            {
                "ask": question.text,
                "choices": question.choices,
                "default": question.default,
                "unit": question.unit,
            }
        )
        return self.typed.line()
