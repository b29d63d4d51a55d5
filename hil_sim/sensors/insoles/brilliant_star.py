"""The boards of Brilliant-Star-ch/Insole-Pressure-Sensor, as its firmware 3.1 writes its log: lines of text.

`time_ms,frame_id,R_ch0…15,L_ch0…15,flags`: the counts of a 12-bit converter, 4095 on an unloaded cell. Here
each foot has a board of its own, whose partner is switched off: the other foot's cells are zeros, and bit 1
of the flags (it was waited for) is set, bit 0 too where it is the left one. Five times as fast as real ones.
"""

from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.sole import Cell, Pressures, calibration_text

UNLOADED = 4095
PASCAL_PER_COUNT = 100.0
NOTHING = ["0"] * 16
LEFT_MISSING, WAITED = 1, 2
CALIBRATION = "brilliant-star.calibration.toml"

# The left foot, from the toes to the heel, each row from the inner to the outer side.
CELLS = tuple(
    Cell(*values)
    for values in (
        (0.232, -0.022, 0.00085),
        (0.224, 0.008, 0.00085),
        (0.193, -0.030, 0.00090),
        (0.193, -0.004, 0.00090),
        (0.186, 0.022, 0.00090),
        (0.162, -0.030, 0.00090),
        (0.162, -0.002, 0.00090),
        (0.158, 0.028, 0.00090),
        (0.126, -0.024, 0.00090),
        (0.126, 0.000, 0.00090),
        (0.126, 0.025, 0.00090),
        (0.090, -0.020, 0.00090),
        (0.090, 0.001, 0.00090),
        (0.090, 0.021, 0.00090),
        (0.042, -0.016, 0.00110),
        (0.042, 0.016, 0.00110),
    )
)


def encode(pressures: Pressures, tick: Tick) -> bytes:
    counts = [str(max(UNLOADED - round(pascal / PASCAL_PER_COUNT), 0)) for pascal in pressures.pascal]
    cells = [*counts, *NOTHING] if pressures.right else [*NOTHING, *counts]
    flags = WAITED | LEFT_MISSING * pressures.right
    head = (tick.time_ns // 1_000_000 & 0xFFFF_FFFF, tick.number & 0xFFFF_FFFF)
    return ",".join(map(str, (*head, *cells, flags))).encode("ascii") + b"\r\n"


INSOLE = SerialFormat(
    encode,
    baudrate=230400,
    banner=b"[SD] init OK.\r\n[FW] v3.1.0\r\n",
    keys=f'calibration = "{CALIBRATION}"   # counts to pressure: gwrms calibrate insole writes one\n',
    beside={CALIBRATION: calibration_text(PASCAL_PER_COUNT)},
)
