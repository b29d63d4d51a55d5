"""A robot that shows a code, and takes whoever proves it."""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from gateway.access import changes
from gateway.access.folder import AccessFolder
from gateway.access.pairing import Candidate, Pairing
from gateway.client import Address
from gateway.connections.listeners import listen
from gateway.wire.pairing import Reply
from gateway.wire.role import Role
from tests.unit.gateway import keyed as keys
from tests.unit.gateway.keyed import keyed

CODE = "0123-4567-89AB-CDEF"


class Shown:
    """A robot that shows `CODE`, and takes whoever proves it for an operator."""

    def __init__(self, folder: Path) -> None:
        self.folder = AccessFolder(keyed(folder, {}), {})
        self.listener = listen("127.0.0.1", 0)
        self.time_s = 0.0
        self.own = keys.pin(keys.ROBOT)
        self.pairing = Pairing(self.folder, self.listener, CODE, self.own, clock=lambda: self.time_s)
        self.where = Address("127.0.0.1", self.listener.getsockname()[1])
        self._pool = ThreadPoolExecutor(1)

    def wait(self) -> "Future[Candidate]":
        return self._pool.submit(self.pairing.wait)

    def take(self, waiting: "Future[Candidate]", name: str = "anna") -> None:
        candidate = waiting.result()
        changes.add(self.folder, name, candidate.der, Role.OPERATOR)
        candidate.answer(Reply(self.pairing.proof(candidate), "exo-01", 7420, name, "operator"))

    def close(self) -> None:
        self.time_s = 1e9
        self._pool.shutdown()
        self.listener.close()
