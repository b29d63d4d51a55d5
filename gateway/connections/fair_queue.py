"""A fair queue of clients' requests: by address in turn, then by connection in turn.

So nobody waits for all that another one wants, however many times it has connected.
"""

from collections import deque
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

T = TypeVar("T")
R = TypeVar("R")


class Client(Protocol):
    """Whoever wants something: a session."""

    @property
    def address(self) -> str: ...

    @property
    def closed(self) -> bool:
        """Whether it has gone."""

    def on_close(self, farewell: Callable[[], None], whose: object = None) -> None: ...


class FairQueue(Generic[T]):
    """Queue of waiting work. It belongs to the loop's thread. The work of a gone client is dropped."""

    def __init__(self) -> None:
        self._waiting: dict[str, dict[Client, deque[T]]] = {}  # by address

    def add(self, client: Client, item: T) -> None:
        """Let it come after what the same client has wanted before; never, where that has gone."""
        if client.closed:
            return
        clients = self._waiting.setdefault(client.address, {})
        if client not in clients:
            clients[client] = deque()
            client.on_close(lambda: self._forget(client), self)
        clients[client].append(item)

    def next(self, way: Callable[[T], R | None]) -> tuple[Client, T, R] | None:
        """Return the first item of the longest waiting client, of those in which `way` finds one.

        It stays that client's first until it is `done`.
        """
        for address, clients in self._waiting.items():
            for client, items in clients.items():
                found = way(items[0])
                if found is not None:
                    clients[client] = clients.pop(client)  # behind the others
                    self._waiting[address] = self._waiting.pop(address)
                    return client, items[0], found
        return None

    def done(self, client: Client, item: T) -> None:
        """Remove it from the queue; idempotent."""
        items = self._waiting.get(client.address, {}).get(client)
        if items and items[0] is item:
            items.popleft()
            if not items:
                self._forget(client)

    def _forget(self, client: Client) -> None:
        clients = self._waiting.get(client.address, {})
        clients.pop(client, None)
        if not clients:
            self._waiting.pop(client.address, None)
