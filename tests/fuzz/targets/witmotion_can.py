"""WitMotion's CAN payloads, captured one behind the other, and one by one."""

from drivers.imu.can.witmotion_can import WitmotionCanParser, decode
from tests.fuzz.serial_streams import judge

TOKENS = tuple(bytes((0x55, kind)) for kind in range(0x50, 0x5B))
MODULES = ("drivers.imu.can.witmotion_can", "drivers.parsing")


def fuzz(data: bytes) -> None:
    judge(WitmotionCanParser, data)
    decode(data[:8])
