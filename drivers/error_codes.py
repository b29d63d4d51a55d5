"""Error codes of EMCY and of 603Fh: CiA 301 classes, CiA 402 and vendors' codes, what to check for each."""

import re
from collections.abc import Mapping
from typing import Final

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

_WIRING: Final = "check the motor's cable and windings for a short circuit, and its connectors"
_BUS: Final = "check termination, wiring, bitrate and load of the bus (gwrms describe)"
_FEEDBACK: Final = "check the encoder, its cable and its connectors, and home the joint again"

# What to check, by code or by its high byte or the upper half of that: the longest that fits counts.
_CHECKS: Final[Mapping[int, str]] = {
    0x1000: "look into the drive's manual for the code; note what the joint did just before",
    0x1090: "flash a firmware that fits the hardware",
    0x2000: "check that the joint moves freely, its load, and the current limits",
    0x2100: "check the supply's cable and fuses for a short circuit",
    0x2300: "check that the joint moves freely, its load and current limits, and the motor's cable",
    0x2320: _WIRING,
    0x2330: _WIRING,
    0x2340: _WIRING,
    0x2350: "let the motor cool down; check its load, and the rated current that the drive is told",
    0x2351: "lower the load before the drive faults; check the rated current that the drive is told",
    0x3000: "check the battery or supply, its fuses and cables",
    0x3110: "check the supply's voltage; braking may feed back more than it takes",
    0x3120: "charge the battery, check the supply, its fuses and cables",
    0x3130: "check the supply's phases and fuses",
    0x3200: "check the battery or supply; braking may feed back more than it takes",
    0x3210: "lower the deceleration, or fit a brake chopper: braking feeds back more than the supply takes",
    0x3220: "charge the battery, check the supply, its fuses and cables; enable fewer joints at once",
    0x4000: "let it cool down; check its cooling and its load",
    0x4120: "let it warm up",
    0x4220: "let it warm up",
    0x4320: "let it warm up",
    0x5000: "switch its power off and on; if it comes again, the drive needs repair",
    0x5100: "check the logic supply and its fuse",
    0x5530: "load its parameters anew (gwrms restore), and store them",
    0x6000: "switch its power off and on; if it comes again, update or replace the firmware",
    0x6300: "load its parameters anew (gwrms restore), and look which one does not fit",
    0x7000: "check what is attached to the drive: brake, encoder, motor",
    0x7110: "check the brake chopper and its resistor",
    0x7120: "check that the joint moves freely, and the motor's phases and commutation",
    0x7121: "free the joint; check for something jammed, and the wearer's posture",
    0x7300: _FEEDBACK,
    0x7500: "switch its power off and on; if it comes again, the drive needs repair",
    0x8000: "look into the drive's manual for what it monitors",
    0x8100: _BUS,
    0x8130: f"see that the controller and the gateway run; {_BUS}",
    0x8150: "give each device a node id of its own",
    0x8200: "compare the PDOs that the controller sends with the drive's mapping (gwrms describe)",
    0x8250: "see that the controller runs and sends its PDOs in time",
    0x8300: "check the joint's load and its torque limit",
    0x8400: "check the joint's load and the velocity controller's gains",
    0x8500: "check the joint's load and the position controller's gains",
    0x8600: "check the joint's load, the gains, and how fast the target moves",
    0x8611: "check that the joint moves freely; then its gains, its torque limit and the window 6065h",
    0x8612: "check the target and the software limits (607Dh)",
    0x8700: "see that the controller sends SYNC, at its pace",
    0x8A00: "check the joint's position against its limit switches and limits",
    0x8A80: "lead the joint off its limit switch by hand",
    0x8A81: "lead the joint off its limit switch by hand",
    0x8A82: "lead the joint within its limits by hand (607Dh)",
    0x8A88: "release the emergency stop or close the safety circuit (STO)",
    0x9000: "check what is wired to the drive's inputs, the emergency stop above all",
    0xF000: "look into the drive's manual for the code",
    0xFF00: "look into the vendor's manual for the code",
}
_WRITTEN: Final = re.compile(r"0x([0-9A-Fa-f]{4})\b")
_UNKNOWN: Final = "look into the drive's manual for the code"


def error_text(code: int, vendor_id: int | None = None) -> str:
    """Return an error code of an EMCY or of 603Fh, in words: the vendor's, the profile's, or its class."""
    vendors = _VENDORS.get(vendor_id or 0, {})
    words = vendors.get(code) or _CODES.get(code) or _class_text(code)
    return f"0x{code:04X} {words}"


def code_in(text: str) -> int | None:
    """Return the first code in a text, as `error_text` writes it; None where there is none."""
    found = _WRITTEN.search(text)
    return None if found is None else int(found[1], 16)


def error_check(code: int) -> str:
    """Return the check to make for an error code; a vendor's own code falls into its standard class."""
    masks = (0xFFFF, 0xFFF0, 0xFF00, 0xF000)
    return next((said for mask in masks if (said := _CHECKS.get(code & mask)) is not None), _UNKNOWN)


def _class_text(code: int) -> str:
    high = code >> 8
    return _CLASSES.get(high) or _CLASSES.get(high & 0xF0) or "error of an unknown class"
