"""Events on their way from the network's thread to the one that shows them."""

import collections

from server_gui.core.follow.events import Event, Telemetry


class Mailbox:
    """Two bounded queues: telemetry is newest-wins, what is rare is never pushed out by it.

    `put` may be called from the network's thread while another thread drains: a deque's ends are safe for
    that.
    """

    def __init__(self, telemetry_depth: int = 1024, rare_depth: int = 4096) -> None:
        self._telemetry: collections.deque[Telemetry] = collections.deque(maxlen=telemetry_depth)
        self._rare: collections.deque[Event] = collections.deque(maxlen=rare_depth)

    def put(self, event: Event) -> None:
        """Hand an event over; the oldest goes where nobody drains."""
        if isinstance(event, Telemetry):
            self._telemetry.append(event)
        else:
            self._rare.append(event)

    def drain(self) -> list[Event]:
        """Everything that has come, what is rare first."""
        return [*_empty(self._rare), *_empty(self._telemetry)]


def _empty(queue: "collections.deque[Telemetry] | collections.deque[Event]") -> list[Event]:
    # As many as there are now: one that goes on filling must not hold its reader.
    return [queue.popleft() for _ in range(len(queue))]
