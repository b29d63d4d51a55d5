"""The SDO channels of a device: the one of the predefined connection set, and those of 1200h to 127Fh."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from hil_sim.clock import Clock
from hil_sim.node import cob_id
from hil_sim.node.dictionary import Dictionary
from hil_sim.node.sdo import SdoServer

FIRST, LAST = 0x1200, 0x127F
_REQUEST, _RESPONSE = 1, 2  # sub-indices
_DEFAULTS = {(FIRST, _REQUEST): 0x600, (FIRST, _RESPONSE): 0x580}  # with the node id


@dataclass(frozen=True, slots=True)
class SdoChannel:
    """A server and the identifiers of its requests and answers."""

    request: int
    response: int
    server: SdoServer


class SdoChannels:
    """One server a channel; `moved` is told when a channel listens elsewhere."""

    def __init__(
        self,
        clock: Clock,
        dictionary: Dictionary,
        node_id: Callable[[], int],
        send: Callable[[int, bytes], None],
        moved: Callable[[], None],
    ) -> None:
        self._dictionary = dictionary
        self._node_id = node_id
        self._send = send
        indices = {FIRST, *dictionary.indices(FIRST, LAST)}
        self._servers = {
            index: SdoServer(clock, dictionary, self._sender(index)) for index in sorted(indices)
        }
        for index in indices:
            for entry in dictionary.members(index)[1:3]:
                entry.on_write = cob_id.guard(entry)
                entry.on_written = moved

    def channels(self) -> Iterator[SdoChannel]:
        """Yield those that exist now."""
        for index, server in self._servers.items():
            request, response = self._cob_id(index, _REQUEST), self._cob_id(index, _RESPONSE)
            if cob_id.is_valid(request) and cob_id.is_valid(response):
                yield SdoChannel(request & cob_id.IDENTIFIER, response & cob_id.IDENTIFIER, server)

    def reset(self) -> None:
        for server in self._servers.values():
            server.reset()

    def _sender(self, index: int) -> Callable[[bytes], None]:
        return lambda data: self._send(self._cob_id(index, _RESPONSE) & cob_id.IDENTIFIER, data)

    def _cob_id(self, index: int, subindex: int) -> int:
        default = _DEFAULTS.get((index, subindex), cob_id.INVALID)
        return self._dictionary.number((index, subindex)) or default + self._node_id()
