"""What a scenario expects: something observed, a condition, and when it must hold."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fnmatch import fnmatchcase
from typing import NamedTuple

Seen = float | str | None  # a number, a word, or nothing

_TOLD = 4  # changes that a line of the result tells


class Track(Enum):
    """What is observed over time; the value is what a scenario calls it."""

    STATE = "component"  # each component's state, as the gateway says
    PROBLEM = "problem"  # … and what is wrong with it in words, "" for nothing
    CHANNEL = "channel"  # each channel's value at the gateway, the word where it has words
    TRUTH = "truth"  # the robot itself
    ANSWER = "answer"  # what the gateway answered to a line of the scenario


class Moment(NamedTuple):
    """What was seen on one track at one simulated time."""

    time_s: float
    values: Mapping[str, Seen]


Observed = Mapping[Track, Sequence[Moment]]


class When(Enum):
    """How a condition has to hold."""

    AT = "at_s"  # at the first look at or after a time
    WITHIN = "within_s"  # at some moment of a window
    BETWEEN = "between_s"  # at every moment of a window


@dataclass(frozen=True, slots=True)
class Timing:
    """When a condition has to hold (simulated s)."""

    when: When
    begin_s: float
    end_s: float

    @property
    def words(self) -> str:
        window = f"{self.begin_s:g} and {self.end_s:g} s"
        return {
            When.AT: f"at {self.begin_s:g} s",
            When.WITHIN: f"once between {window}",
            When.BETWEEN: f"always between {window}",
        }[self.when]

    def choose(self, moments: Sequence[Moment]) -> list[Moment]:
        """Return the moments that count."""
        if self.when is When.AT:
            return [moment for moment in moments if moment.time_s >= self.begin_s][:1]
        return [moment for moment in moments if self.begin_s <= moment.time_s <= self.end_s]


@dataclass(frozen=True, slots=True)
class Condition:
    """What a value must be, and how that is said."""

    words: str
    holds: Callable[[Seen], bool]


@dataclass(frozen=True, slots=True)
class Verdict:
    """One line of the result: what was expected, and what was seen."""

    ok: bool
    expected: str
    seen: str


@dataclass(frozen=True, slots=True)
class Expectation:
    """One thing that must be so, for every name that fits the glob."""

    track: Track
    glob: str
    condition: Condition
    timing: Timing

    @property
    def words(self) -> str:
        what = {Track.TRUTH: "true ", Track.ANSWER: "answer to ", Track.PROBLEM: "problem of "}
        return f"{what.get(self.track, '')}{self.glob} {self.condition.words} {self.timing.words}"

    def is_open(self, observed: Observed, now_s: float) -> bool:
        """Return whether what comes later can still change the verdict."""
        if self.timing.when is When.AT:
            return not self.timing.choose(observed.get(self.track, ()))
        over = now_s > self.timing.end_s
        return not over and (self.timing.when is When.BETWEEN or not self.judge(observed).ok)

    def judge(self, observed: Observed) -> Verdict:
        """Compare with what was seen."""
        moments = observed.get(self.track, ())
        names = sorted({name for moment in moments for name in moment.values if fnmatchcase(name, self.glob)})
        if not names:
            return Verdict(False, self.words, f"there is no {self.track.value} {self.glob}")
        verdicts = [self._judge_one(name, moments) for name in names]
        return next((verdict for verdict in verdicts if not verdict.ok), verdicts[-1])

    def _judge_one(self, name: str, moments: Sequence[Moment]) -> Verdict:
        chosen = self.timing.choose([moment for moment in moments if name in moment.values])
        series = [(moment.time_s, moment.values[name]) for moment in chosen]
        if not series:
            return Verdict(False, self.words, f"nothing was seen of {name} then")
        right = [(time_s, value) for time_s, value in series if self.condition.holds(value)]
        wrong = [(time_s, value) for time_s, value in series if not self.condition.holds(value)]
        if self.timing.when is When.BETWEEN:
            return Verdict(not wrong, self.words, f"{name} was {_story(wrong or right)}")
        return Verdict(bool(right), self.words, f"{name} was {_story(right[:1] or series)}")


def _story(series: Sequence[tuple[float, Seen]]) -> str:
    """What was seen, in words: the range of numbers, or each new word with its time."""
    numbers = [value for _, value in series if isinstance(value, float)]
    span = f"from {series[0][0]:.2f} to {series[-1][0]:.2f} s"
    if len(numbers) == len(series) > 1:
        return f"{min(numbers):.4g} to {max(numbers):.4g} {span}"
    changes = list(_changes(series))
    if len(changes) == 1 < len(series):
        return f"{_say(changes[0][1])} {span}"
    told = ", then ".join(f"{_say(value)} at {time_s:.2f} s" for time_s, value in changes[:_TOLD])
    return told + (f", and {len(changes) - _TOLD} more changes" if len(changes) > _TOLD else "")


def _changes(series: Sequence[tuple[float, Seen]]) -> Iterator[tuple[float, Seen]]:
    """Each value that differs from the one before; of numbers in a row the first."""
    before: object = series
    for time_s, value in series:
        if value != before and not (isinstance(value, float) and isinstance(before, float)):
            yield time_s, value
        before = value


def _say(value: Seen) -> str:
    if value is None:
        return "missing"
    return f"{value:.4g}" if isinstance(value, float) else repr(value)
