"""SDO abort codes (CiA 301 §7.2.4.3.17)."""

from enum import IntEnum


class AbortCode(IntEnum):
    """The abort codes that a simulated device gives."""

    TOGGLE_BIT = 0x0503_0000
    TIMED_OUT = 0x0504_0000
    UNKNOWN_COMMAND = 0x0504_0001
    INVALID_BLOCK_SIZE = 0x0504_0002
    INVALID_SEQUENCE = 0x0504_0003
    CRC_ERROR = 0x0504_0004
    OUT_OF_MEMORY = 0x0504_0005
    UNSUPPORTED_ACCESS = 0x0601_0000
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_SUCH_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    PDO_TOO_LONG = 0x0604_0042
    INCOMPATIBLE = 0x0604_0043
    HARDWARE_ERROR = 0x0606_0000
    LENGTH_MISMATCH = 0x0607_0010
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUCH_SUBINDEX = 0x0609_0011
    INVALID_VALUE = 0x0609_0030
    TOO_HIGH = 0x0609_0031
    TOO_LOW = 0x0609_0032
    NOT_STORABLE = 0x0800_0020
    WRONG_STATE = 0x0800_0022
    NO_DATA = 0x0800_0024


class SdoAbort(Exception):
    """A request that the device refuses."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(f"{code:08X}h {code.name}")
        self.code = code
