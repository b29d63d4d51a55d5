"""BNO08x sensors in UART-RVC mode."""

from drivers.imu.formats.bno08x_rvc import Bno08xRvcParser
from tests.fuzz.serial_streams import judge

TOKENS = (b"\xaa\xaa", b"\xaa\xaa\0", b"\xff\x7f", b"\0\x80")
MODULES = ("drivers.imu.formats.bno08x_rvc", "drivers.parsing")


def fuzz(data: bytes) -> None:
    judge(Bno08xRvcParser, data)
