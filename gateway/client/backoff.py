"""Pauses between attempts: doubling, bounded, with jitter."""

import random
from collections.abc import Callable


class Backoff:
    """Waiting times that double from `first_s` to at most `longest_s`, each shortened by up to half.

    The jitter keeps fifty clients of a robot that comes back from knocking in the same millisecond.
    """

    def __init__(
        self, first_s: float = 0.1, longest_s: float = 5.0, jitter: Callable[[], float] = random.random
    ) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._jitter = jitter
        self._next_s = first_s

    def reset(self) -> None:
        """Begin with the shortest wait again: the last attempt was a success."""
        self._next_s = self._first_s

    def next_s(self) -> float:
        """Return the next pause in seconds."""
        wait_s = self._next_s
        self._next_s = min(2 * wait_s, self._longest_s)
        return wait_s * (1.0 - 0.5 * self._jitter())
