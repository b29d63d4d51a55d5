"""The messages of `gwrms commission --json`, a line each; an unknown one is shown as it is."""

from collections.abc import Collection, Iterable
from typing import Final

import msgspec

from gateway.units import with_minus

NOT_SAID: Final = "not known"
CONFIRMED: Final = "confirmed"
NOT_CONFIRMED: Final = "NOT CONFIRMED"
DRIVES_ONLY: Final = "A STOP will reach the drives only"  # with which the command says so
MOVED: Final = "counts moved"  # unit of how far a drive has counted since it was asked to be moved
LEAST_MOVE: Final = 50  # as the command judges it
CLEARLY: Final = 10  # times as far as any other drive
NO_POWER: Final = "no power"
ENTER: Final = " Then press Enter."


class ReadingMessage(msgspec.Struct, frozen=True):
    """A device's value while a question waits; `value` is `None` without one."""

    name: str
    value: float | str | None
    unit: str = ""

    @property
    def text(self) -> str:
        """The value with its unit; a dash where there is none."""
        if self.value is None:
            return f"— {self.unit}".rstrip()
        told = self.value if isinstance(self.value, str) else with_minus(f"{self.value:.10g}")
        return f"{told} {self.unit}".rstrip()


class StepMessage(msgspec.Struct, frozen=True):
    """One step: of which part of the robot, and whether it is done, now, next or passed."""

    part: str
    title: str
    state: str


class WrittenMessage(msgspec.Struct, frozen=True):
    """Result of writing the robot's file."""

    file: str
    text: str
    findings: tuple[tuple[str, str], ...] = ()
    usable: bool = False
    unfinished: tuple[str, ...] = ()
    not_journaled: str = ""


class StoppedMessage(msgspec.Struct, frozen=True):
    """Result of a stop: outcome by drive, its state in words, and after how many ms it has confirmed.

    States and times are of those that have told them; an older command tells none.
    """

    confirmed: bool
    words: str
    drives: dict[str, str] = {}
    states: dict[str, str] = {}
    after_ms: dict[str, float] = {}

    @property
    def why(self) -> str:
        """Why it is not confirmed, beside the words that it is not."""
        return self.words.removeprefix(f"{NOT_CONFIRMED}: ")

    def has_confirmed(self, drive: str) -> bool:
        """Return whether this drive has."""
        return self.drives.get(drive) == CONFIRMED

    def rows(self, off: Collection[str] = ()) -> tuple[tuple[str, str, str], ...]:
        """Return a row a drive: its name, its state, and when it confirmed the STOP; else that it did not.

        Those that were `off` before had nothing to stop: they have only answered.
        """
        return tuple(
            (drive, self.states.get(drive, NOT_SAID), self._when(drive, said, was_off=drive in off))
            for drive, said in self.drives.items()
        )

    def _when(self, drive: str, said: str, *, was_off: bool) -> str:
        after_ms = self.after_ms.get(drive)
        if said != CONFIRMED:
            return f"{NOT_CONFIRMED}: {said}"
        if after_ms is None:
            return "was off · answered" if was_off else "confirmed"
        after = f"after {max(after_ms, 1.0):.0f} ms"
        return f"was off · answered {after}" if was_off else after


def mover(readings: Iterable[ReadingMessage]) -> str:
    """Return the drive that has moved enough, and far more than every other; "" while none has."""
    moved = {
        one.name: abs(one.value)
        for one in readings
        if one.unit == MOVED and isinstance(one.value, int | float)
    }
    order = sorted(moved, key=lambda name: moved[name], reverse=True)
    if not order or moved[order[0]] < LEAST_MOVE:
        return ""
    return "" if len(order) > 1 and moved[order[1]] * CLEARLY > moved[order[0]] else order[0]


def without_power(readings: Iterable[ReadingMessage]) -> frozenset[str]:
    """Return the drives that say that they have no power."""
    return frozenset(one.name for one in readings if str(one.value).startswith(NO_POWER))


class Error(msgspec.Struct, frozen=True):
    """Reason why it cannot continue."""

    message: str


class Message(msgspec.Struct, frozen=True):
    """Any line: of these, what it has."""

    say: str | None = None
    file: str = ""
    ask: str | None = None
    number: int = 0
    choices: tuple[str, ...] = ()
    default: str | None = None
    unit: str = ""
    bounds: tuple[float, float] | None = None
    press: bool = False
    refused: str = ""
    live: tuple[ReadingMessage, ...] | None = None
    problem: str = ""
    moving: str | msgspec.UnsetType | None = msgspec.UNSET  # a joint is under power; None: no longer
    steps: tuple[StepMessage, ...] | None = None
    written: WrittenMessage | None = None
    stopped: StoppedMessage | None = None
    error: Error | None = None

    @property
    def question(self) -> str:
        """The question, without the parts for terminals."""
        return (self.ask or "").removesuffix(ENTER)

    @property
    def range(self) -> str:
        """Between which numbers an answer is."""
        if self.bounds is None:
            return ""
        low, high = self.bounds
        return f"{low:g} to {high:g} {self.unit}".rstrip()


def understood(text: str) -> Message:
    """Return a line; one that is not understood says what it is."""
    try:
        return msgspec.json.decode(text, type=Message)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return Message(say=text)


def answer(text: str, number: int) -> str:
    """Return the line that answers the question of this number, and no other."""
    return msgspec.json.encode({"answer": text, "number": number}).decode()


STOP: Final = '{"stop": true}'
