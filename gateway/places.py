"""Who may be connected: so many clients, and beyond them always somebody who may stop the robot."""

import time
from collections.abc import Callable

from gateway import wire
from gateway.session import Session

CLIENTS = 64
STOPPERS = 16  # beyond them, who may only stop
SILENT_S = 10.0  # who has said nothing for so long since it came makes room where all places are taken


class Places:
    """Every session that is open. It belongs to the loop's thread."""

    def __init__(self) -> None:
        self._clients: set[Session] = set()
        self._stoppers: set[Session] = set()

    @property
    def taken(self) -> tuple[Session, ...]:
        """Those who are connected."""
        return (*self._clients, *self._stoppers)

    def admit(self, open_: Callable[[wire.RpcError | None], Session]) -> Session:
        """Open a session, as a client where a place is free; else with the refusal of all but a stop."""
        if self._has_place():
            return self._placed(open_(None), self._clients)
        if len(self._stoppers) >= STOPPERS:
            # One that waits for an answer has been heard: what it asked for is being done.
            silent = min(self._stoppers, key=lambda one: (one.waits, one.heard_ns))
            silent.close(_refusal("others come; connect again"))
        return self._placed(open_(_refusal("this connection takes robot.stop only")), self._stoppers)

    def _has_place(self) -> bool:
        if len(self._clients) < CLIENTS:
            return True
        before_ns = time.monotonic_ns() - round(SILENT_S * 1e9)
        silent = [one for one in self._clients if not one.spoke and one.heard_ns <= before_ns]
        if not silent:
            return False
        why = f"this connection has said nothing for {SILENT_S:g} s, and made room"
        min(silent, key=lambda one: one.heard_ns).close(_refusal(why))
        return True

    @staticmethod
    def _placed(session: Session, places: set[Session]) -> Session:
        places.add(session)
        session.on_close(lambda: places.discard(session))
        return session


def _refusal(what: str) -> wire.RpcError:
    return wire.refuse(wire.Kind.UNAVAILABLE, f"{CLIENTS} clients are connected, which is the most; {what}")
