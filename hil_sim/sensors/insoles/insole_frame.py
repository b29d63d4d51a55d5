"""A printed sole of 18 cells with a fixed frame: `AA foot(1 left, 2 right) 18×u16 sum`, big-endian.

The cells are counts of a 12-bit converter, `PASCAL_PER_COUNT` each; the frame has neither number nor time.
"""

import struct

from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.sole import Cell, Pressures, calibration_text

HEAD = 0xAA
FULL_SCALE = 4095
PASCAL_PER_COUNT = 100.0

CELLS = tuple(
    Cell(*values)
    for values in (
        (0.022, -0.015, 0.00092),
        (0.022, 0.015, 0.00092),
        (0.052, -0.016, 0.00096),
        (0.052, 0.016, 0.00096),
        (0.086, -0.018, 0.00086),
        (0.086, 0.018, 0.00086),
        (0.120, -0.021, 0.00090),
        (0.120, 0.022, 0.00090),
        (0.152, -0.030, 0.00072),
        (0.152, 0.002, 0.00072),
        (0.152, 0.033, 0.00072),
        (0.182, -0.031, 0.00072),
        (0.182, -0.003, 0.00072),
        (0.182, 0.022, 0.00072),
        (0.214, -0.010, 0.00060),
        (0.214, 0.012, 0.00060),
        (0.204, 0.030, 0.00055),
        (0.236, -0.024, 0.00070),
    )
)


def encode(pressures: Pressures, _tick: Tick) -> bytes:
    counts = [min(round(pascal / PASCAL_PER_COUNT), FULL_SCALE) for pascal in pressures.pascal]
    body = struct.pack(">BB18H", HEAD, 2 if pressures.right else 1, *counts)
    return body + bytes([sum(body) & 0xFF])


CALIBRATION = "insole-18.calibration.toml"
KEYS = f"""\
layout = "insole-18"            # its cells, and how its frame is laid out
calibration = "{CALIBRATION}"   # counts to pressure: gwrms calibrate insole writes one
"""

INSOLE = SerialFormat(
    encode, baudrate=115200, keys=KEYS, beside={CALIBRATION: calibration_text(PASCAL_PER_COUNT)}
)
