"""Emergency messages (EMCY) in words: CiA 301 classes, CiA 402 codes, and a table per vendor."""

from collections.abc import Mapping
from dataclasses import dataclass

# CiA 301 table 26: the classes of emergency error codes, by their high byte.
_CLASSES: dict[int, str] = {
    0x00: "error reset or no error",
    0x10: "generic error",
    0x20: "current",
    0x21: "current, device input side",
    0x22: "current inside the device",
    0x23: "current, device output side",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage inside the device",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "device temperature",
    0x43: "drive temperature",
    0x50: "device hardware",
    0x60: "device software",
    0x61: "internal software",
    0x62: "user software",
    0x63: "data set",
    0x70: "additional modules",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "device specific",
}

# CiA 301 communication codes and CiA 402-2 annex, error codes of drives.
_CODES: dict[int, str] = {
    0x2110: "short circuit or earth leakage at the input",
    0x2211: "current inside the device no. 1",
    0x2212: "current inside the device no. 2",
    0x2213: "overcurrent in the ramp function",
    0x2214: "overcurrent in the sequence",
    0x2220: "continuous overcurrent inside the device",
    0x2230: "short circuit or earth leakage inside the device",
    0x2310: "continuous overcurrent at the output",
    0x2311: "overcurrent at the output no. 1",
    0x2312: "overcurrent at the output no. 2",
    0x2320: "short circuit or earth leakage at the output",
    0x2330: "earth leakage at the output",
    0x2340: "short circuit at the output",
    0x2350: "load level too high (I²t, thermal state)",
    0x2351: "load level warning (I²t, thermal state)",
    0x3110: "mains overvoltage",
    0x3120: "mains undervoltage",
    0x3130: "phase failure",
    0x3210: "DC link overvoltage",
    0x3220: "DC link undervoltage",
    0x3310: "output overvoltage",
    0x3320: "armature circuit",
    0x3330: "field circuit",
    0x4110: "ambient temperature too high",
    0x4120: "ambient temperature too low",
    0x4210: "device temperature too high",
    0x4220: "device temperature too low",
    0x4310: "drive temperature too high",
    0x4320: "drive temperature too low",
    0x5112: "24 V supply",
    0x5113: "5 V supply",
    0x5114: "supply of the logic",
    0x5200: "measurement circuit",
    0x5300: "operating unit",
    0x5400: "power section",
    0x5410: "output stages",
    0x5430: "input stages",
    0x5441: "contact 1",
    0x5500: "data storage",
    0x5510: "working memory",
    0x5520: "program memory",
    0x5530: "non-volatile memory",
    0x6010: "software reset by the watchdog",
    0x6301: "data record 1",
    0x6310: "loss of parameters",
    0x6320: "parameter error",
    0x7110: "brake chopper failure",
    0x7121: "motor blocked",
    0x7122: "motor error or commutation malfunction",
    0x7123: "motor tilted",
    0x7300: "sensor",
    0x7301: "tachometer",
    0x7302: "tachometer polarity",
    0x7303: "resolver 1",
    0x7304: "resolver 2",
    0x7305: "incremental encoder 1",
    0x7306: "incremental encoder 2",
    0x7310: "speed sensor",
    0x7320: "position sensor",
    0x7380: "hall sensor",
    0x7500: "communication inside the device",
    0x7510: "serial interface 1",
    0x8110: "CAN overrun: messages were lost",
    0x8120: "CAN in error passive mode",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus off",
    0x8150: "CAN identifier collision",
    0x8210: "PDO not processed: wrong length",
    0x8220: "PDO length exceeded",
    0x8240: "unexpected SYNC length",
    0x8250: "RPDO timeout",
    0x8311: "torque too high",
    0x8312: "difficult start-up",
    0x8313: "standstill torque",
    0x8321: "torque too low",
    0x8331: "torque fault",
    0x8400: "velocity control",
    0x8500: "position control",
    0x8600: "positioning control",
    0x8611: "following error too large",
    0x8612: "reference limit",
    0x8700: "SYNC control",
    0x8800: "winding control",
    0x8900: "process data monitoring",
    0x8A00: "control monitoring",
}

# Vendors' own codes, by the vendor id of 1018h:1; written from their public firmware manuals.
_VENDORS: dict[int, Mapping[int, str]] = {
    0x00FB: {  # maxon motor, EPOS4
        0x1080: "generic initialization error",
        0x1090: "firmware incompatibility",
        0x2320: "power stage protection",
        0x4210: "thermal overload of the power stage",
        0x4380: "thermal overload of the motor",
        0x5113: "logic supply voltage too low",
        0x5280: "hardware defect",
        0x6080: "sign of life",
        0x6380: "persistent parameters corrupt",
        0x7380: "position sensor breach",
        0x7381: "position sensor resolution",
        0x7382: "position sensor index",
        0x7388: "hall sensor",
        0x7389: "hall sensor not found",
        0x738A: "hall angle detection",
        0x738C: "SSI sensor",
        0x7390: "main sensor missing",
        0x7391: "commutation sensor missing",
        0x7392: "main sensor direction",
        0x81FD: "CAN bus turned off",
        0x81FE: "CAN receive queue overflow",
        0x81FF: "CAN transmit queue overflow",
        0x8A80: "negative limit switch",
        0x8A81: "positive limit switch",
        0x8A82: "software position limit",
        0x8A88: "safe torque off (STO)",
        0xFF01: "system overloaded",
        0xFF02: "watchdog",
        0xFF0B: "system peak overloaded",
        0xFF10: "controller gain",
        0xFF11: "auto tuning identification",
        0xFF12: "auto tuning current limit",
    },
}

_REGISTER_BITS = ("generic", "current", "voltage", "temperature", "communication", "profile", "", "vendor")


@dataclass(frozen=True, slots=True)
class Emcy:
    """One emergency message (CiA 301 §7.2.7)."""

    stamp_ns: int
    code: int
    register: int  # 1001h, bits by `_REGISTER_BITS`
    vendor_data: bytes

    @property
    def resets(self) -> bool:
        """Whether it says that the errors are over."""
        return self.code >> 8 == 0

    def text(self, vendor_id: int | None = None) -> str:
        """`0x8611 following error too large (register: generic, profile)`."""
        bits = [name for bit, name in enumerate(_REGISTER_BITS) if name and self.register >> bit & 1]
        register = f" (register: {', '.join(bits)})" if bits else ""
        return f"{error_text(self.code, vendor_id)}{register}"


def parse_emcy(stamp_ns: int, data: bytes) -> Emcy | None:
    """An EMCY frame; `None` for one that is too short."""
    if len(data) < 3:
        return None
    return Emcy(stamp_ns, int.from_bytes(data[:2], "little"), data[2], data[3:])


def error_text(code: int, vendor_id: int | None = None) -> str:
    """An error code of an EMCY or of 603Fh, in words: the vendor's, the profile's, or its class."""
    vendors = _VENDORS.get(vendor_id or 0, {})
    words = vendors.get(code) or _CODES.get(code) or _class_text(code)
    return f"0x{code:04X} {words}"


def _class_text(code: int) -> str:
    high = code >> 8
    return _CLASSES.get(high) or _CLASSES.get(high & 0xF0) or "error of an unknown class"
