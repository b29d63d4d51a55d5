"""A sensor's serial line: from the frames that it means to send to the bytes that arrive."""

import random
from typing import Protocol

from hil_sim.sensors.faults import LineFaults
from hil_sim.sensors.uart import heard_at


class Port(Protocol):
    """End of the line: a pseudo-terminal, or a listener in a test."""

    @property
    def baudrate(self) -> int:
        """At which whoever reads it listens."""
        ...

    def plug(self, plugged: bool) -> None:
        """Plug it in or out; called again and again."""
        ...

    def write(self, data: bytes) -> None: ...


class SerialLine:
    """Carries what a sensor sends at `baudrate` to `port`; without a port it is lost."""

    def __init__(self, baudrate: int, faults: LineFaults, random_source: random.Random) -> None:
        self.baudrate = baudrate
        self.faults = faults
        self.port: Port | None = None
        self._random = random_source

    def send(self, data: bytes) -> None:
        """Send the bytes of one cycle."""
        port, faults = self.port, self.faults
        if port is None:
            return
        port.plug(not faults.unplugged)
        if not faults.unplugged and not self._hits(faults.dropout_share):
            sent_baud = faults.wrong_baud or self.baudrate
            same = port.baudrate == sent_baud
            port.write(self._disturbed(data if same else heard_at(data, sent_baud, port.baudrate)))

    def _disturbed(self, data: bytes) -> bytes:
        share = self.faults.garbage_share
        if not share:
            return data
        return bytes(self._random.randrange(256) if self._hits(share) else byte for byte in data)

    def _hits(self, share: float) -> bool:
        return share > 0.0 and self._random.random() < share
