"""SDO abort codes in words that a person can act on (CiA 301 table 22)."""

NO_OBJECT = 0x0602_0000

ABORT_CODES: dict[int, str] = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "the SDO protocol timed out",
    0x0504_0001: "the device does not know this SDO command",
    0x0504_0002: "invalid block size",
    0x0504_0003: "invalid block sequence number",
    0x0504_0004: "block checksum wrong",
    0x0504_0005: "the device is out of memory",
    0x0601_0000: "the object does not allow this access",
    0x0601_0001: "the object is write-only",
    0x0601_0002: "the object is read-only",
    NO_OBJECT: "the device has no such object; its EDS is of another firmware",
    0x0604_0041: "the object cannot be mapped to a PDO",
    0x0604_0042: "the mapping is longer than a PDO",
    0x0604_0043: "the parameter does not fit this device",
    0x0604_0047: "the parameters contradict each other inside the device",
    0x0606_0000: "the device's hardware is at fault",
    0x0607_0010: "the length does not fit the object; its EDS is of another firmware",
    0x0607_0012: "too long for the object; its EDS is of another firmware",
    0x0607_0013: "too short for the object; its EDS is of another firmware",
    0x0609_0011: "the object has no such sub-index",
    0x0609_0030: "the value is not allowed",
    0x0609_0031: "the value is too high",
    0x0609_0032: "the value is too low",
    0x0609_0036: "the maximum is below the minimum",
    0x060A_0023: "a resource is not available: SDO connection",
    0x0800_0000: "a general error",
    0x0800_0020: "the data cannot be stored or transferred",
    0x0800_0021: "the device is under local control",
    0x0800_0022: "the device's present state does not allow it",
    0x0800_0023: "the device has no object dictionary",
    0x0800_0024: "there is no data",
}


def abort_text(abort_code: int) -> str:
    """Return the code and what it means."""
    return f"{ABORT_CODES.get(abort_code, 'a code of the vendor')} (abort 0x{abort_code:08X})"
