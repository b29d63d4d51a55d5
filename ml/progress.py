"""Progress of long work: a function that reports it."""

from typing import Protocol


class Tell(Protocol):
    """Hears what is done now, and how much of it: `done` of `total` steps of the same kind."""

    def __call__(self, what: str, done: int, total: int) -> None: ...


def untold(what: str, done: int, total: int) -> None:
    """Do nothing, for whoever does not want to know."""
