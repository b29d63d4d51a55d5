"""WitMotion's CAN variant: the serial frames without sum and last word, each in one CAN frame."""

import struct

from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.sensors.faults import LineFaults
from hil_sim.sensors.imus.witmotion import HEAD, vectors
from hil_sim.sensors.trunk_imu import AXES, BusImu, Motion

CAN_ID = 0x50  # as delivered


def payloads(motion: Motion) -> list[bytes]:
    """Acceleration, angular rate and angle: 55h, type, three int16, little-endian."""
    return [struct.pack("<BB3h", HEAD, kind, *words) for kind, words in vectors(motion).items()]


class WitmotionCan:
    """The IMU as a participant of the bus."""

    def __init__(self, bus: CanBus, faults: LineFaults) -> None:
        self._bus = bus
        self._faults = faults

    def tell(self, motion: Motion, _now_ns: int) -> None:
        if not self._faults.unplugged:
            for payload in payloads(motion):
                self._bus.send(Frame(CAN_ID, payload), self)


KEYS = f"""\
format = "witmotion-can"
can_id = 0x{CAN_ID:02X}                   # of its frames, as set in it
{AXES}"""

IMUS = {"witmotion-can": BusImu(lambda _clock, bus, _name, faults: WitmotionCan(bus, faults), KEYS)}
