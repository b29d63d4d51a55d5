"""Objects of one node read straight from its bus, where no gateway runs; nothing is ever written."""

import threading
from collections.abc import Iterator, Sequence
from typing import Final

from drivers.bus.bus import CanBus
from drivers.bus.outlet import Requests
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import SDO_REQUEST, SDO_RESPONSE, CanSettings
from drivers.errors import DeviceAbort, DriverError, Unavailable
from drivers.scan.identification import TIMEOUT_S
from drivers.scan.scan import await_open

LISTEN_S: Final = 1.0  # a gateway, or a controller, that reads by SDO does so more often
Object = tuple[int, int]


def read_objects(
    settings: CanSettings, node: int, objects: Sequence[Object], listen_s: float = LISTEN_S
) -> Iterator[tuple[Object, bytes | DriverError]]:
    """Read each, unless somebody else asks the node: two who ask at once get each other's answers.

    After one that was not answered nothing more is asked; the rest has the same reason.

    Raises:
        Unavailable: the interface cannot be opened, or somebody else asks the node.

    """
    bus, others, wait = CanBus(str(settings.channel), settings), threading.Event(), threading.Event().wait
    channel = SdoChannel(f"node {node} on {bus.name}", Requests(bus, SDO_REQUEST + node), TIMEOUT_S)

    def heard(_stamp_ns: int, _data: bytes) -> None:
        others.set()

    bus.subscribe(SDO_REQUEST + node, heard)
    bus.subscribe(SDO_RESPONSE + node, channel.on_response)
    bus.start()
    try:
        await_open(bus, wait)
        if others.wait(listen_s):
            raise Unavailable(
                f"somebody else asks node {node} on {bus.name} by SDO, and is left alone: "
                "ask the gateway that does, or end it first"
            )
        yield from _each(channel, objects)
    finally:
        bus.stop()


def _each(channel: SdoChannel, objects: Sequence[Object]) -> Iterator[tuple[Object, bytes | DriverError]]:
    silence: DriverError | None = None
    for one in objects:
        if silence is not None:
            yield one, silence
            continue
        try:
            yield one, channel.upload(*one)
        except DeviceAbort as error:
            yield one, error
        except DriverError as error:
            silence = error
            yield one, error
