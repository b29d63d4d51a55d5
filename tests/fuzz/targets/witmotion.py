"""WitMotion's serial frames."""

from drivers.imu.formats.witmotion import WitmotionParser
from tests.fuzz.serial_streams import judge

TOKENS = tuple(bytes((0x55, kind)) for kind in range(0x50, 0x5B))
MODULES = ("drivers.imu.formats.witmotion", "drivers.parsing")


def fuzz(data: bytes) -> None:
    judge(WitmotionParser, data)
