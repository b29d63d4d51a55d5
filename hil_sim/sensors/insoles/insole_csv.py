"""An insole of eight force-sensing resistors on a hobby board: a line of text a scan.

`t_ms;seq;foot;flags;c0;…;c7`: the converter's counts fall with the load, 4095 is an unloaded cell, and each
foot counts its own lines. A cell's pressure is 4 Pa times its missing counts to the power of 1.4.
"""

from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.sole import Cell, Pressures

UNLOADED = 4095
_GAIN_PA, _EXPONENT = 4.0, 1.4
_MILLISECOND_NS = 1_000_000

CELLS = tuple(
    Cell(*values)
    for values in (
        (0.032, -0.014, 0.00190),
        (0.032, 0.014, 0.00190),
        (0.105, 0.022, 0.00220),
        (0.180, -0.031, 0.00180),
        (0.178, 0.002, 0.00170),
        (0.158, 0.034, 0.00180),
        (0.228, -0.024, 0.00170),
        (0.216, 0.012, 0.00160),
    )
)


def encode(pressures: Pressures, tick: Tick) -> bytes:
    loads = [round((pascal / _GAIN_PA) ** (1 / _EXPONENT)) for pascal in pressures.pascal]
    counts = ";".join(str(max(UNLOADED - load, 0)) for load in loads)
    head = f"{tick.time_ns // _MILLISECOND_NS & 0xFFFF_FFFF};{tick.number & 0xFFFF_FFFF}"
    return f"{head};{'R' if pressures.right else 'L'};0;{counts}\r\n".encode("ascii")


INSOLE = SerialFormat(
    encode,
    baudrate=115200,
    banner=b"# ets Jul 29 2019 12:21:46\r\nsensor ready\r\n",
    keys='layout = "insole-8"             # its cells, what its columns are, a calibration\n',
)
