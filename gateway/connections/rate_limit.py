"""Rate limit of clients: the CPU time that reading them costs, and the pause that follows for each."""

import time

from gateway.connections.fair_share import TimeSharing
from gateway.process.loop import Loop

TURN_NS = 500_000  # what those may take together that are not known, before the others are read
PACE_S = 0.005  # how long a client that sends more than may wait is left alone after each read
COSTLY_NS = 300_000  # what a client's reads may take of the thread at once; beyond, it is left alone …
PACE_FACTOR = 4  # … for so many times as long as they took, and for each client that is left alone just now.
LONGEST_REST_S = 1.0  # So they all together leave the thread most of its time
FLOOD = 8  # stops at once, of a client; who sends more floods the drives with them …
FLOOD_S = 0.05  # … and is read again so much later: as many more are given to it in twice that time


class RateLimit(TimeSharing):
    """Shares of an intake's thread; clients that are not known yet take turns."""

    def __init__(self, front: Loop) -> None:
        super().__init__(front, TURN_NS)
        self.resting = 0  # clients that are left alone just now
        self._known_turn, self._known_until_ns = -1, 0

    def has_time_for_known(self) -> bool:
        """Return whether this turn's own time for known clients is left."""
        now_ns = time.monotonic_ns()
        if self._known_turn != self._loop.turns:
            self._known_turn, self._known_until_ns = self._loop.turns, now_ns + TURN_NS
        return now_ns < self._known_until_ns

    def rest_s(self, spent_ns: int) -> float:
        """Return the pause of a client with such a cost."""
        return min(LONGEST_REST_S, max(PACE_S, PACE_FACTOR * (self.resting + 1) * spent_ns / 1e9))


class Account:
    """One client's recent cost for the thread, and its stops that still count."""

    def __init__(self) -> None:
        self.owed_ns = 0  # of the thread's time
        self._owed_at_ns = 0
        self._spent_ns = 0  # since it was last taken
        self._stops, self._stops_at_s = 0.0, 0.0

    def pay(self, spent_ns: int) -> None:
        """Put down what a read has cost."""
        self._spent_ns += spent_ns
        self._owe(spent_ns)

    def take_spent_ns(self) -> int:
        """Return all that was put down since the last call."""
        spent_ns, self._spent_ns = self._spent_ns, 0
        return spent_ns

    def settle(self) -> int:
        """Return the present debt; while it costs nothing, it is forgotten."""
        self._owe(0)
        return self.owed_ns

    def floods(self, stops: int) -> bool:
        """Return whether these and the last ones are too many. All of them act; they are read later."""
        now_s = time.monotonic()
        forgotten = (now_s - self._stops_at_s) * FLOOD / (2 * FLOOD_S)
        self._stops, self._stops_at_s = max(0.0, self._stops - forgotten) + stops, now_s
        floods = stops > 0 and self._stops > FLOOD
        self._stops = min(self._stops, FLOOD)
        return floods

    def _owe(self, spent_ns: int) -> None:
        now_ns = time.monotonic_ns()
        forgotten_ns = (now_ns - self._owed_at_ns) // PACE_FACTOR
        self.owed_ns, self._owed_at_ns = max(0, self.owed_ns - forgotten_ns) + spent_ns, now_ns
