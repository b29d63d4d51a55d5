"""The first quick stop of a cold start: to every joint, before what confirms a stop has even been imported.

Nobody reads an answer: the stop that follows, with all its modules, asks again and confirms. It leaves by a
connection of its own, so only on interfaces that more than one may have open.
"""

import logging
import threading
import time

from gateway.config import RobotConfig

log = logging.getLogger(__name__)

SHARED = ("socketcan", "socketcand")
ROOM_S = 0.1  # how long a bus that takes no frame is waited for


class FirstStop:
    """A thread a bus, so that a dead one delays no other. It belongs to the loop's thread."""

    def __init__(self, config: RobotConfig) -> None:
        self._config = config
        self._threads: list[threading.Thread] = []

    def begin(self) -> None:
        """Send it everywhere, unless that is being done."""
        if any(thread.is_alive() for thread in self._threads):
            return
        used = {joint.bus for joint in self._config.joint.values()}
        self._threads = [
            threading.Thread(target=self._send, args=(bus,), name=f"first stop on {bus}")
            for bus, settings in self._config.can.items()
            if bus in used and settings.interface in SHARED
        ]
        for thread in self._threads:
            thread.start()

    def join(self) -> None:
        """Wait until what was begun is over."""
        for thread in self._threads:
            thread.join()

    def _send(self, bus: str) -> None:
        from drivers.bus.opening import open_transport  # for a cold stop only
        from drivers.errors import Unavailable

        try:
            transport = open_transport(self._config.can[bus])
            try:
                until = time.monotonic() + ROOM_S
                for can_id, data in self._requests(bus):
                    while not transport.try_send(can_id, data) and time.monotonic() < until:
                        transport.await_room(ROOM_S)
            finally:
                transport.close()
        except Unavailable as error:
            log.warning("no quick stop yet on bus %s: %s", bus, error)

    def _requests(self, bus: str) -> list[tuple[int, bytes]]:
        from drivers.bus.sdo import expedited
        from drivers.joint.commands import CONTROLWORD, Controlword
        from drivers.joint.quantities import AXIS_OFFSET

        joints = [joint for joint in self._config.joint.values() if joint.bus == bus]
        stop = Controlword.QUICK_STOP.data
        return [
            (joint.sdo_ids(joint.node_id)[0], expedited(CONTROLWORD + joint.axis * AXIS_OFFSET, 0, stop))
            for joint in joints
        ]
