"""Names and groups of local users, looked up in the background, with a time limit.

A directory of accounts on the network may hang, and nothing can interrupt who asks it. So nobody who reads
clients asks; and who is let in by number alone comes in without an answer.
"""

import threading
from collections.abc import Callable
from functools import partial
from typing import Final

from gateway.access.identity import Peer
from gateway.access.users import is_maintainer, resolved
from gateway.wire.limits import HANDSHAKE_S, HANDSHAKES

SHORT_S: Final = 0.3  # for a name that the journal alone needs

Decide = Callable[[Peer], object]  # whether that is known; called in a thread of its own


class Accounts:
    """Look-ups, each in a thread that `end` joins."""

    def __init__(self, finished: Callable[[], object]) -> None:
        """`finished` is called after each."""
        self._finished = finished
        self._lock = threading.Lock()
        self._under_way = 0
        self._hanging: list[threading.Thread] = []  # or not done yet
        self._threads: list[threading.Thread] = []

    @property
    def busy(self) -> bool:
        """Whether somebody's name is being looked for."""
        return self._under_way > 0

    def take(self, peer: Peer, decide: Decide) -> bool:
        """Decide with name and groups, if they are known in time; false where too many are being asked for.

        Called by one thread.
        """
        self._threads = [one for one in self._threads if one.is_alive()]
        if len(self._threads) >= HANDSHAKES:
            return False
        with self._lock:
            self._under_way += 1
        thread = threading.Thread(target=self._look, args=(peer, decide), name="account")
        self._threads.append(thread)
        thread.start()
        return True

    def end(self) -> None:
        """Wait for what is under way, which takes no longer than `HANDSHAKE_S`."""
        for thread in self._threads:
            thread.join()

    def _look(self, peer: Peer, decide: Decide) -> None:
        try:
            decide(self._asked(peer) or peer)
        finally:
            with self._lock:
                self._under_way -= 1
            self._finished()

    def _asked(self, peer: Peer) -> Peer | None:
        """Ask for the names; nothing if nobody answers in time, or so many have not answered yet."""
        found: list[Peer] = []
        # Of no owner: whoever hangs in the system's directory can be joined by nobody.
        asking = threading.Thread(target=partial(_ask, peer, found), name="directory", daemon=True)
        with self._lock:
            self._hanging = [one for one in self._hanging if one.is_alive()]
            if len(self._hanging) >= HANDSHAKES:
                return None
            self._hanging.append(asking)
            asking.start()
        asking.join(SHORT_S if is_maintainer(peer) else HANDSHAKE_S)
        return found[0] if found else None


def _ask(peer: Peer, found: list[Peer]) -> None:
    found.append(resolved(peer))
