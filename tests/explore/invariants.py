"""What must never be: each a small function whose docstring is the sentence, called when its time has come.

A check looks at the facts and says in words what is wrong, or nothing. Add one in `about_….py` with its mark.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from tests.explore.facts import Facts
from tests.explore.gateway_life import Asked

Complaints = Iterator[str]
Check = Callable[[Facts], Complaints]
AnswerCheck = Callable[[Facts, Asked], Complaints]


@dataclass(frozen=True, slots=True)
class Invariants:
    """All there are, by their functions' names."""

    always: dict[str, Check] = field(default_factory=dict)
    at_answers: dict[str, AnswerCheck] = field(default_factory=dict)
    at_the_end: dict[str, Check] = field(default_factory=dict)

    def sentence(self, name: str) -> str:
        checks = {**self.always, **self.at_answers, **self.at_the_end}
        return " ".join((checks[name].__doc__ or "").split()) if name in checks else name


@dataclass(frozen=True, slots=True)
class Judged:
    """Which of them count: those that are named, or all but those ignored, where the text says so."""

    only: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    saying: str = ""  # a regular expression

    def counts(self, invariant: str, text: str) -> bool:
        named = invariant in self.only if self.only else invariant not in self.ignored
        return named and re.search(self.saying, text) is not None


KNOWN = Invariants()
EVERYTHING = Judged()


def always(check: Check) -> Check:
    """Judged between any two tasks: cheap where nothing is wrong."""
    KNOWN.always[check.__name__] = check
    return check


def at_answers(check: AnswerCheck) -> AnswerCheck:
    """Judged when a request is answered."""
    KNOWN.at_answers[check.__name__] = check
    return check


def at_the_end(check: Check) -> Check:
    """Judged when everything was made well and has come to rest."""
    KNOWN.at_the_end[check.__name__] = check
    return check
