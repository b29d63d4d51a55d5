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
class At:
    """Begin of a step, of those in `gateway.commission.progress`. It needs no answer."""

    part: str  # of the robot, or a joint
    step: str


@dataclass(frozen=True, slots=True)
class Say:
    """Something to be read; nobody answers it."""

    text: str


@dataclass(frozen=True, slots=True)
class DeviceReading:
    """A device's value while a question waits; `value` is `None` without one."""

    name: str
    value: float | str | None
    unit: str = ""


Live = Callable[[], Sequence[DeviceReading]]  # raises `DriverError` where a device does not answer


@dataclass(frozen=True, slots=True)
class Ask:
    """Something to be answered. An empty answer is the `default`, where there is one."""

    text: str
    choices: tuple[str, ...] = ()  # one of these; without, whatever the text says
    default: str | None = None
    unit: str = ""  # of a number
    bounds: tuple[float, float] | None = None  # of a number
    press: bool = False  # Enter is the answer
    refused: str = ""  # why the answer before would not do, which was said
    live: Live | None = None  # for faces that can show it meanwhile; in the thread of `Face.ask` only


@dataclass(frozen=True, slots=True)
class Moving:
    """A joint is under power now: said again and again, and sent "" as long as nobody has pressed STOP."""

    text: str


Talk = Generator[Say | Ask | Moving | At, str, T]


class Face(Protocol):
    """A face of the dialogue: shows messages and reads answers."""

    def say(self, text: str) -> None: ...

    def ask(self, question: Ask) -> str:
        """Return the typed answer; raises `EOFError` at the end of the input."""
        ...

    def moving(self, text: str) -> str:
        """Show it, with STOP in reach, and look for some hundredths of a second whether it is pressed.

        Returns why to stop, "" where there is no reason. Nothing that could be a STOP may be missed.
        """
        ...


def run(talk: Talk[T], face: Face, at: Callable[[At], None] | None = None) -> T:
    """Lead the dialogue to its end; closing it early leaves what was found until then.

    `at` is told where it is. Whatever is raised, by a face or a signal, closes the dialogue: who moves or
    switches anything in one undoes that in a `finally`.
    """
    typed: str | None = None
    try:
        while True:
            step = next(talk) if typed is None else talk.send(typed)
            typed = None
            if isinstance(step, At):
                if at is not None:
                    at(step)
            elif isinstance(step, Say):
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


def press(text: str, live: Live | None = None) -> Talk[None]:
    """Wait until somebody has done what is said."""
    yield Ask(f"{text} Then press Enter.", press=True, live=live)


def word(
    text: str, default: str | None = None, check: Callable[[str], str | None] | None = None
) -> Talk[str]:
    """Ask for text; `check` says what is wrong with it."""
    refused = ""
    while True:
        typed = yield Ask(text, default=default, refused=refused)
        problem = "an answer is needed" if not typed else check(typed) if check is not None else None
        if problem is None:
            return typed
        yield Say(refused := problem)


def choose(
    text: str, choices: Sequence[str], default: str | None = None, live: Live | None = None
) -> Talk[str]:
    """One of `choices`; the beginning of one will do."""
    refused = ""
    while True:
        typed = yield Ask(text, tuple(choices), default, refused=refused, live=live)
        found = [one for one in choices if one == typed] or [
            one for one in choices if typed and one.startswith(typed)
        ]
        if len(found) == 1:
            return found[0]
        yield Say(refused := f"{typed!r} is none of {', '.join(choices)}")


def agree(text: str) -> Talk[bool]:
    """Ask; return whether somebody says yes. No answer is a no."""
    typed = yield Ask(text, (YES, NO), NO)
    return typed.lower() in (YES, "yes")


def number(
    text: str, unit: str, low: float, high: float, default: float | None = None, live: Live | None = None
) -> Talk[float]:
    """Ask for a number of this range, in this unit."""
    told, refused = None if default is None else f"{default:g}", ""
    while True:
        typed = yield Ask(text, (), told, unit, (low, high), refused=refused, live=live)
        found = _number(typed.removesuffix(unit))
        if low <= found <= high:
            return found
        yield Say(refused := f"{typed!r} is no number of {low:g} to {high:g} {unit}".rstrip())


def _number(typed: str) -> float:
    try:
        return float(typed)
    except ValueError:
        return math.nan
