"""A collector that runs in another process, asked through its door without waiting for it."""

from concurrent.futures import Future
from pathlib import Path

import msgspec

from server_gui.core.fleet.collector import CollectorReport, Note
from server_gui.core.fleet.control_socket import ANSWER_S, ask
from server_gui.core.threads.background import Background


class RemoteCollector:
    """Whoever records into this spool; futures fail with `NobodyCollects` where nobody does."""

    def __init__(self, spool: Path) -> None:
        self._spool = spool
        self._asking = Background("asking the collector")

    def close(self) -> None:
        """Ask nothing more. Idempotent."""
        self._asking.close(2 * ANSWER_S)

    def report(self) -> "Future[CollectorReport]":
        """Return how everything goes there."""
        return self._asking.do(lambda: msgspec.json.decode(ask(self._spool, "status"), type=CollectorReport))

    def mark(self, text: str, ago_s: float = 0.0) -> "Future[int]":
        """Mark this instant, or one before, in the recording of every robot there; how many there are."""
        if not ago_s:
            return self._asking.do(lambda: int(ask(self._spool, "mark", text)))
        note = msgspec.json.encode(Note(text, ago_s)).decode()
        return self._asking.do(lambda: int(ask(self._spool, "note", note)))

    def upload(self) -> "Future[int]":
        """Bring everything that was recorded until now into the store; how many batches waited."""
        return self._asking.do(lambda: int(ask(self._spool, "upload")))
