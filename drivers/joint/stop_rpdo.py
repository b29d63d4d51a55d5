"""A quick stop by RPDO, for a bus whose master we are: sooner than SDO, and confirmed by nothing.

The RPDO must take effect without anybody else's SYNC. Its other objects are sent as the drive has them: as
they were when it came up, or as we have written them since; where that is not known, it is not sent.
"""

from dataclasses import dataclass

from drivers.bus.nmt import NmtState
from drivers.bus.node import Node
from drivers.bus.rpdo import Rpdo, find_rpdo, read_values
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import Role
from drivers.errors import DeviceAbort
from drivers.joint.commands import CONTROLWORD, Controlword

Object = tuple[int, int]
Values = dict[Object, bytes]


@dataclass(frozen=True, slots=True)
class StopRpdo:
    """The RPDO that carries one axis's controlword."""

    node: Node
    rpdo: Rpdo
    values: Values  # of its objects, when the drive came up
    controlword: Object

    def send(self) -> bool:
        """Put the quick stop on the bus, from any thread, without blocking; whether it left at once.

        It is not sent where nobody knows what else it would carry.
        """
        if self.node.life.nmt_state not in (NmtState.OPERATIONAL, None):
            return False  # RPDOs are dead in the other states
        values: Values = {self.controlword: Controlword.QUICK_STOP.data}
        for object_ in self.values.keys() - values.keys():
            held = self._held(object_)
            if held is None:
                return False
            values[object_] = held
        return self.node.bus.send_urgent(self.rpdo.can_id, self.rpdo.frame(values))

    def _held(self, object_: Object) -> bytes | None:
        """Return the last confirmed value of an object in the device.

        `None`: nobody knows.
        """
        return self.node.channel.known(*object_, self.values[object_])


def find_stop_rpdo(node: Node, sdo: SdoChannel, axis_offset: int) -> StopRpdo | None:
    """Return the RPDO for a stop of this axis; `None` where it must go by SDO. Raises `DriverError`."""
    if node.bus.role is not Role.MASTER:
        return None
    our_sync = node.bus.settings.sync_period_s is not None
    index = CONTROLWORD + axis_offset
    try:
        for rpdo in find_rpdo(sdo, node.description, index):
            if rpdo.takes_effect(our_sync=our_sync):
                return StopRpdo(node, rpdo, read_values(sdo, rpdo), (index, 0))
    except DeviceAbort:
        return None  # nobody knows what else it would carry
    return None
