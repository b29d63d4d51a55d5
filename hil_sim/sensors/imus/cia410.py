"""A two-axis inclinometer on the CAN bus (CiA 410): slopes in the resolution of object 6000h.

Positive is a slope whose axis points below the horizon; profile and makers leave that open.
"""

import math
from collections.abc import Callable

import eds
from eds.description import Description
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import Clock
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Value
from hil_sim.node.nmt import NmtState
from hil_sim.node.node import Node
from hil_sim.sensors.faults import LineFaults
from hil_sim.sensors.trunk_imu import AXES, BusImu, Motion

EDS = "inclinometer.eds"
NODE_ID = 20

RESOLUTION = (0x6000, 0)
RESOLUTIONS = (1, 10, 100, 1000)  # of 0.001°
# longitudinal and lateral: value and operating parameter, 16 and 32 bits
LONGITUDINAL, LATERAL = ((0x6010, 0x6011), (0x6110, 0x6111)), ((0x6020, 0x6021), (0x6120, 0x6121))

_INVERTED = 0x01


class Inclinometer(Node):
    """The node; it shows what it was given last, and starts by itself, as if told so in 1F80h."""

    def __init__(
        self, clock: Clock, bus: CanBus, name: str, description: Description, faults: LineFaults
    ) -> None:
        super().__init__(clock, bus, name, NODE_ID, description)
        self._faults = faults
        self._slopes = (0.0, 0.0)
        self.dictionary[RESOLUTION].on_write = _check_resolution
        for axis, objects in enumerate((LONGITUDINAL, LATERAL)):
            for value, parameter in objects:
                self.dictionary[value, 0].source = self._counts(axis, parameter)

    def tell(self, motion: Motion, _now_ns: int) -> None:
        """Show the slopes of `motion`; without power, show nothing."""
        if self._faults.unplugged is self.powered:
            (self.power_off if self.powered else self.power_on)()
        w, x, y, z = motion.orientation
        self._slopes = (math.asin(2 * (w * y - x * z)), math.asin(-2 * (y * z + w * x)))

    def _on_booted(self) -> None:
        self._enter(NmtState.OPERATIONAL)

    def _counts(self, axis: int, parameter: int) -> Callable[[], Value]:
        def counts() -> Value:
            sign = -1 if self.dictionary[parameter, 0].number() & _INVERTED else 1
            return sign * round(
                math.degrees(self._slopes[axis]) * 1000 / self.dictionary[RESOLUTION].number()
            )

        return counts


def _check_resolution(value: Value) -> None:
    if value not in RESOLUTIONS:
        raise SdoAbort(AbortCode.INVALID_VALUE)


def _make(clock: Clock, bus: CanBus, name: str, faults: LineFaults) -> Inclinometer:
    return Inclinometer(clock, bus, name, eds.load(eds.locate(EDS, None), NODE_ID), faults)


KEYS = f"""\
format = "cia410"               # an inclinometer: tilt, and nothing else
node_id = {NODE_ID}
directions = [1, 1]             # of its x and y axis: 1 where positive means that it points below the horizon
{AXES}"""

IMUS = {"cia410": BusImu(_make, KEYS)}
