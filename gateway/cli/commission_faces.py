"""The terminal as a face of commissioning: words, lines that are typed, and a STOP."""

import signal
import time
from collections.abc import Callable

from gateway.cli.line_input import Typed, looks_like_stop
from gateway.cli.text import say
from gateway.commission.dialogue import Ask
from gateway.commission.progress import CommissionStep
from gateway.commission.writing import Written

LOOK_S = 0.03  # for a STOP, each time
SHOW_S = 0.5  # between two words of a joint that moves


class Terminal:
    """Words, and lines that are typed."""

    def __init__(self) -> None:
        self.typed = Typed()
        self.stop_asked = False
        self._shown = 0.0  # when words of a motion were shown; 0: nothing moves

    def stop_wanted(self, show: Callable[[], None]) -> str:
        if time.monotonic() - self._shown > SHOW_S:
            self._shown = time.monotonic()
            show()
        return self.typed.waits(LOOK_S)

    def over(self) -> bool:
        """Return whether a motion has ended since."""
        ended, self._shown = self._shown > 0, 0.0
        if ended:
            self.typed.drop()
        return ended

    def say(self, text: str) -> None:
        self.over()
        say(text + "\n")

    def propose(self, made: str, _file: str) -> None:
        self.say(made)

    def written(self, written: Written) -> None:
        self.say(written.words)

    def steps(self, steps: tuple[CommissionStep, ...]) -> None:
        """Questions say it themselves."""

    def moving(self, text: str) -> str:
        return self.stop_wanted(lambda: say(f"  {text}\n"))

    def ask(self, question: Ask) -> str:
        choices = f" [{'/'.join(question.choices)}]" if question.choices else ""
        default = f" (Enter: {question.default})" if question.default else ""
        self.over()
        say(f"\n{question.text}{choices}{default}\n> ")
        line = self.typed.line()
        if looks_like_stop(line, press=question.press):
            self.stop_asked = True
            signal.raise_signal(signal.SIGINT)
        return line
