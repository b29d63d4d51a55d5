"""Questions and answers as generators: they yield what is said and asked, and are sent what was typed.

Whoever runs one is its face: the terminal, a page of a window, a test. An answer that will not do is told,
and the question comes again.
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

T = TypeVar("T")
NO, YES = "n", "y"


@dataclass(frozen=True, slots=True)
class Say:
    """Something to be read; nobody answers it."""

    text: str


@dataclass(frozen=True, slots=True)
class Ask:
    """Something to be answered. An empty answer is the `default`, where there is one."""

    text: str
    choices: tuple[str, ...] = ()  # one of these; without, whatever the text says
    default: str | None = None
    unit: str = ""  # of a number


@dataclass(frozen=True, slots=True)
class Moving:
    """A joint is under power now: said again and again, and sent "" as long as nobody has pressed STOP."""

    text: str


Talk = Generator[Say | Ask | Moving, str, T]


class Face(Protocol):
    """Where it is read and typed."""

    def say(self, text: str) -> None: ...

    def ask(self, question: Ask) -> str:
        """What was typed; raises `EOFError` where nothing more can be."""
        ...

    def moving(self, text: str) -> str:
        """Show it, with STOP in reach, and look for some hundredths of a second whether it is pressed.

        Returns why to stop, "" where there is no reason. Nothing that could be a STOP may be missed.
        """
        ...


def run(talk: Talk[T], face: Face) -> T:
    """Lead the dialogue to its end; closing it early leaves what was found until then."""
    typed: str | None = None
    try:
        while True:
            step = next(talk) if typed is None else talk.send(typed)
            typed = None
            if isinstance(step, Say):
                face.say(step.text)
            elif isinstance(step, Moving):
                typed = face.moving(step.text)
            else:
                typed = face.ask(step).strip() or (step.default or "")
    except StopIteration as end:
        found: T = end.value
        return found
    finally:
        talk.close()


def press(text: str) -> Talk[None]:
    """Wait until somebody has done what is said."""
    yield Ask(f"{text} Then press Enter.")


def word(
    text: str, default: str | None = None, check: Callable[[str], str | None] | None = None
) -> Talk[str]:
    """A word or more; `check` says what is wrong with it."""
    while True:
        typed = yield Ask(text, default=default)
        problem = "an answer is needed" if not typed else check(typed) if check is not None else None
        if problem is None:
            return typed
        yield Say(problem)


def choose(text: str, choices: Sequence[str], default: str | None = None) -> Talk[str]:
    """One of `choices`; the beginning of one will do."""
    while True:
        typed = yield Ask(text, tuple(choices), default)
        found = [one for one in choices if one == typed] or [
            one for one in choices if typed and one.startswith(typed)
        ]
        if len(found) == 1:
            return found[0]
        yield Say(f"{typed!r} is none of {', '.join(choices)}")


def agree(text: str) -> Talk[bool]:
    """Whether somebody says yes; no word is a no."""
    typed = yield Ask(text, (YES, NO), NO)
    return typed.lower() in (YES, "yes")


def number(text: str, unit: str, low: float, high: float, default: float | None = None) -> Talk[float]:
    """A number of this range, in this unit."""
    while True:
        typed = yield Ask(text, default=None if default is None else f"{default:g}", unit=unit)
        found = _number(typed.removesuffix(unit))
        if low <= found <= high:
            return found
        yield Say(f"{typed!r} is no number of {low:g} to {high:g} {unit}".rstrip())


def _number(typed: str) -> float:
    try:
        return float(typed)
    except ValueError:
        return math.nan
