"""ASCII and binary messages of VectorNav devices, in one stream."""

from drivers.imu.formats.vectornav import VectornavParser
from tests.fuzz.serial_streams import judge

TOKENS = (
    b"$VNYPR,",
    b"$VNQTN,",
    b"$VNIMU,",
    b"*",
    b"\r\n",
    b"\xfa\x01",
    b"\xfa\x05",
    b"nan",
    b"1e999",
    b"-0.1,",
)
MODULES = ("drivers.imu.formats.vectornav", "drivers.parsing")


def fuzz(data: bytes) -> None:
    judge(VectornavParser, data)
