"""Xbus messages of Xsens devices."""

from drivers.imu.formats.xsens import XsensParser
from tests.fuzz.serial_streams import judge

TOKENS = (b"\xfa\xff", b"\xfa\xff\x36", b"\xff\x07\xff", b"\x20\x10\x10", b"\x10\x20\x02", b"\x40\x20\x0c")
MODULES = ("drivers.imu.formats.xsens", "drivers.parsing")


def fuzz(data: bytes) -> None:
    judge(XsensParser, data)
