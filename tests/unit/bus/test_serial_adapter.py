"""A CAN adapter on a serial port that takes nothing: its bus says so, and ends when it is told to."""

import threading

from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable
from tests.bench._blocked_bus import blocked_bus
from tests.support.waiting import WAIT_S, until


def test_a_bus_whose_adapter_takes_nothing_says_so_and_can_be_closed() -> None:
    with blocked_bus() as port:
        bus = CanBus("main", CanSettings(interface="slcan", channel=port))
        bus.start()
        until(lambda: bus.opened)
        told: list[str] = []

        def sends() -> bool:
            try:
                bus.send(0x601, bytes(8))
            except Unavailable as error:
                told.append(str(error))
            return bool(told)

        until(sends)
        assert "does not send" in told[0] or "takes" in told[0]
        ending = threading.Thread(target=bus.stop)
        ending.start()
        ending.join(WAIT_S)
        assert not ending.is_alive()
