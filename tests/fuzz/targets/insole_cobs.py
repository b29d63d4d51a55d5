"""The default binary insole frame."""

from drivers.insole.formats.insole_cobs import InsoleCobsParser
from tests.fuzz.serial_streams import judge

TOKENS = (b"\0", b"\x01", b"\x31", b"\x31\x02", b"\xff\xff")
MODULES = ("drivers.insole.formats.insole_cobs", "drivers.parsing")


def fuzz(data: bytes) -> None:
    judge(InsoleCobsParser, data)
