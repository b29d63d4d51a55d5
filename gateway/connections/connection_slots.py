"""Connection slots: a limited number for clients, and some in reserve for stopping the robot."""

import time
from collections.abc import Callable, Iterable

from gateway.connections.session import Session
from gateway.wire import framing
from gateway.wire.limits import CLIENTS, CLIENTS_OF_ONE_ADDRESS, STOPPERS

FRESH_S = 0.3  # how long one of these that has spoken keeps its place whoever comes, from its own coming on
SILENT_S = 10.0  # who has said nothing for so long since it came makes room where all places are taken

_STOPS_ONLY = (
    "this is not done, and this connection ends: to stop the robot, connect and send robot.stop first"
)


class ConnectionSlots:
    """Every session that is open. It belongs to the loop's thread."""

    def __init__(self) -> None:
        self._clients: set[Session] = set()
        self._stoppers: set[Session] = set()

    @property
    def taken(self) -> tuple[Session, ...]:
        """Those who are connected."""
        return (*self._clients, *self._stoppers)

    def admit(self, address: str, open_: Callable[[framing.RpcError | None], Session]) -> Session | None:
        """Open a session, as a client where a place is free; else with the refusal of all but a stop.

        `None` where even for that no place is free: it is told so and closed, and a stop that has come with
        it acts.
        """
        if self._has_place(address):
            return self._placed(open_(None), self._clients)
        opened = open_(_refusal(_STOPS_ONLY))
        if not self._has_place_to_stop(address):
            opened.close(_refusal("and as many who may only stop; connect again"))
            return None
        return self._placed(opened, self._stoppers)

    def _has_place_to_stop(self, address: str) -> bool:
        """One address that opens connections without end takes no place from the others."""
        neighbours = [one for one in self._stoppers if one.address == address]
        if len(neighbours) >= STOPPERS // 2:
            return _make_room(neighbours)
        return len(self._stoppers) < STOPPERS or _make_room(self._stoppers)

    def _has_place(self, address: str) -> bool:
        neighbours = [one for one in self._clients if one.address == address]
        if len(neighbours) >= CLIENTS_OF_ONE_ADDRESS:
            return _one_silent_leaves(neighbours)
        return len(self._clients) < CLIENTS or _one_silent_leaves(self._clients)

    @staticmethod
    def _placed(session: Session, places: set[Session]) -> Session:
        places.add(session)
        session.on_close(lambda: places.discard(session))
        return session


def _make_room(stoppers: Iterable[Session]) -> bool:
    """Close the one that has been silent for longest, unless all have only just come and spoken.

    Who has been here for longer makes room however much it says, and who has not spoken yet however fresh it
    is: so neither talk nor a burst of silent connections keeps anybody out, and a stop that follows its
    connection within a moment is there before so many others.
    """
    before_ns = time.monotonic_ns() - round(FRESH_S * 1e9)
    silent = [one for one in stoppers if not one.spoke or one.came_ns <= before_ns]
    if not silent:
        return False
    # One that waits for an answer has been heard: what it asked for is being done.
    min(silent, key=lambda one: (one.waits, one.heard_ns)).close(_refusal("others come; connect again"))
    return True


def _one_silent_leaves(clients: Iterable[Session]) -> bool:
    """Close one that has said nothing since it came; false where each has."""
    before_ns = time.monotonic_ns() - round(SILENT_S * 1e9)
    silent = [one for one in clients if not one.spoke and one.heard_ns <= before_ns]
    if not silent:
        return False
    why = f"this connection has said nothing for {SILENT_S:g} s, and made room"
    min(silent, key=lambda one: one.heard_ns).close(_refusal(why))
    return True


def _refusal(what: str) -> framing.RpcError:
    most = f"{CLIENTS} clients are connected, or {CLIENTS_OF_ONE_ADDRESS} of your address, which is the most"
    return framing.refuse(framing.ErrorKind.UNAVAILABLE, f"{most}; {what}")
