"""Expectations of a scenario: an observed value, a condition, and its time."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import NamedTuple

Seen = float | str | None  # a number, a word, or nothing

_UNSEEN_S = 1.0  # ten looks
_TOLD = 4  # changes that a line of the result tells


class Track(Enum):
    """An observed quantity over time; the value is its name in scenarios."""

    STATE = "component"  # each component's state, as the gateway says
    PROBLEM = "problem"  # … and what is wrong with it in words, "" for nothing
    CHANNEL = "channel"  # each channel's value at the gateway, the word where it has words
    TRUTH = "truth"  # the robot itself
    ANSWER = "answer"  # what the gateway answered to a line of the scenario
    RULE = "rule"  # each guard rule's state, as the gateway says
    REASON = "reason"  # … and why, in words
    STOP = "stop"  # … and why the robot is held stopped, where that is this rule's doing; "" where not


class Moment(NamedTuple):
    """The values of one track at one simulated time."""

    time_s: float
    values: Mapping[str, Seen]


Observed = Mapping[Track, Sequence[Moment]]

# How a line of the result begins.
_WHOSE = {
    Track.TRUTH: "true ",
    Track.ANSWER: "answer to ",
    Track.PROBLEM: "problem of ",
    Track.RULE: "guard rule ",
    Track.REASON: "reason of guard rule ",
    Track.STOP: "stop by guard rule ",
}
# What a glob names, where the track is not called so.
_NAMED = {
    Track.PROBLEM: "component",
    Track.RULE: "guard rule",
    Track.REASON: "guard rule",
    Track.STOP: "guard rule",
}


class ScenarioResult(StrEnum):
    """Result of an expectation, or of a scenario."""

    PASSED = "passed"
    FAILED = "failed"
    INCONCLUSIVE = "inconclusive"  # it failed where the computer was too slow to judge
    NOT_RUN = "not run"


class When(Enum):
    """Time mode of a condition."""

    AT = "at_s"  # at the first look at or after a time
    WITHIN = "within_s"  # at some moment of a window
    BETWEEN = "between_s"  # at every moment of a window


@dataclass(frozen=True, slots=True)
class Timing:
    """Time of a condition (simulated s)."""

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

    @property
    def over_s(self) -> float:
        """When nothing that comes later counts."""
        return self.begin_s if self.when is When.AT else self.end_s

    def choose(self, moments: Sequence[Moment]) -> list[Moment]:
        """Return the moments that count."""
        if self.when is When.AT:
            return [moment for moment in moments if moment.time_s >= self.begin_s][:1]
        return [moment for moment in moments if self.begin_s <= moment.time_s <= self.end_s]


@dataclass(frozen=True, slots=True)
class Condition:
    """Condition on a value, and its words."""

    words: str
    holds: Callable[[Seen], bool]


@dataclass(frozen=True, slots=True)
class Verdict:
    """One line of the result: what was expected, what was seen, and by when that was clear (simulated s).

    `doubt` says why a failure proves nothing.
    """

    ok: bool
    expected: str
    seen: str
    decided_s: float = 0.0
    doubt: str = ""

    @property
    def result(self) -> ScenarioResult:
        if self.ok:
            return ScenarioResult.PASSED
        return ScenarioResult.INCONCLUSIVE if self.doubt else ScenarioResult.FAILED


@dataclass(frozen=True, slots=True)
class Expectation:
    """One thing that must be so, for every name that fits the glob."""

    track: Track
    glob: str
    condition: Condition
    timing: Timing

    @property
    def words(self) -> str:
        return f"{_WHOSE.get(self.track, '')}{self.glob} {self.condition.words} {self.timing.words}"

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
            named = _NAMED.get(self.track, self.track.value)
            return Verdict(False, self.words, f"there is no {named} {self.glob}", self.timing.over_s)
        verdicts = [self._judge_one(name, moments) for name in names]
        return next((verdict for verdict in verdicts if not verdict.ok), verdicts[-1])

    def _judge_one(self, name: str, moments: Sequence[Moment]) -> Verdict:
        chosen = self.timing.choose([moment for moment in moments if name in moment.values])
        series = [(moment.time_s, moment.values[name]) for moment in chosen]
        if not series:
            return Verdict(False, self.words, f"nothing was seen of {name} then", self.timing.over_s)
        right = [(time_s, value) for time_s, value in series if self.condition.holds(value)]
        wrong = [(time_s, value) for time_s, value in series if not self.condition.holds(value)]
        between = self.timing.when is When.BETWEEN
        unseen = _unseen(series, self.timing.end_s) if between and not wrong else None
        if unseen is not None:
            begin_s, end_s = unseen
            seen = f"nothing was seen of {name} from {begin_s:.2f} to {end_s:.2f} s"
            return Verdict(False, self.words, seen, end_s)
        deciding = wrong if between else right  # the first of these decides; without any, the end does
        decided_s = deciding[0][0] if deciding else self.timing.over_s
        told = (wrong or right) if between else (right[:1] or series)
        return Verdict(bool(deciding) is not between, self.words, f"{name} was {_story(told)}", decided_s)


def _unseen(series: Sequence[tuple[float, Seen]], end_s: float) -> tuple[float, float] | None:
    """Return the first gap too long for `always`, as of a gateway that stopped answering."""
    times = [*(time_s for time_s, _ in series), end_s]
    return next((gap for gap in pairwise(times) if gap[1] - gap[0] > _UNSEEN_S), None)


def _story(series: Sequence[tuple[float, Seen]]) -> str:
    """Return the observations in words: the range of numbers, or each new word with its time."""
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
    """Yield each value that differs from the one before; of numbers in a row the first."""
    before: object = series
    for time_s, value in series:
        if value != before and not (isinstance(value, float) and isinstance(before, float)):
            yield time_s, value
        before = value


def _say(value: Seen) -> str:
    if value is None:
        return "missing"
    return f"{value:.4g}" if isinstance(value, float) else repr(value)
